//! The priority of a picture among those that share an allocator.

/// The urgency of a picture. It decides the order of work where several pictures share an allocator; pixels are the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Urgency {
    /// A final picture.
    #[default]
    Picture,
    /// A crop, for a test render.
    Crop,
    /// An interactive view. Its units are dropped when the user looks elsewhere.
    Look,
}

impl Urgency {
    /// Returns the priority of blocks of pixels.
    pub(super) const fn priority(self) -> i32 {
        match self {
            Self::Picture => 0,
            Self::Crop => 2,
            Self::Look => 4,
        }
    }

    /// Returns the priority of the coarse survey, which is short, and which the rest of the picture waits for.
    pub(super) const fn first_look(self) -> i32 {
        self.priority() + 1
    }
}
