//! The fast, low-resolution look at a scene from which the Analyst makes its importance map.

/// What the fast pass saw in one pixel; means over its samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurveyPixel {
    /// Levels of recursion in mirror and transparent surfaces (the paper's importance function).
    pub recursion_levels: f32,
    /// Traversal steps (nodes and leaves visited) that one path took.
    pub steps: f32,
    /// Mean radiance, linear RGB.
    pub color: [f32; 3],
    /// Standard deviation of the luminance over the samples.
    pub noise: f32,
    /// Reflectance of the first surface.
    pub albedo: [f32; 3],
    /// Distance to the first surface; 0 where there is none.
    pub depth: f32,
    /// Vertices of one path.
    pub path_length: f32,
}

/// A low-resolution look at the scene, row-major.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Survey {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `[width × height]`.
    pub pixels: Vec<SurveyPixel>,
}
