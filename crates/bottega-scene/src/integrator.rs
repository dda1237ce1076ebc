//! The integrator that a file asks for.

/// The integrator that a file names.
#[derive(Clone, Debug, PartialEq)]
pub struct IntegratorHint {
    /// As the file names it.
    pub name: String,
    /// Where the file names it, such as `scene.pbrt:3:1`; may be empty.
    pub place: String,
    /// From where it follows light.
    pub follows: Follows,
}

/// From where an integrator follows light: what it finds, and how one of ours finds the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Follows {
    /// Paths from the camera.
    Paths {
        /// Whether it does what our path tracer does, so that nothing is replaced.
        is_ours: bool,
    },
    /// Paths from the lights, alone or with others from the camera: lamps without extent are found over mirrors and through
    /// glass.
    BothEnds,
    /// Photons, gathered where the camera sees them, with more and more of them to come.
    Photons(PhotonHints),
}

/// The hints of a file about photons.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhotonHints {
    /// Photons that leave the lights in each pass.
    pub count: Option<u32>,
    /// Radius of the first pass, in scene units.
    pub radius: Option<f32>,
    /// How far photons may lie where they are counted, as a share of the radius of the scene.
    pub radius_share: Option<f32>,
    /// The nearest photons from which light is estimated.
    pub gather: Option<u32>,
}
