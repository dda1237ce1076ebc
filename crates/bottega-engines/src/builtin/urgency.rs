//! The urgency of a picture among those that the same processors paint.

/// How soon somebody wants to see what is painted. It decides who goes first where several pictures share an allocator, and no pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Urgency {
    /// A whole picture.
    #[default]
    Picture,
    /// A part of one, in which somebody tries something.
    Crop,
    /// What somebody looks at while it is painted. Its units live until he looks elsewhere.
    Look,
}

impl Urgency {
    /// The priority of blocks of pixels.
    pub(super) const fn priority(self) -> i32 {
        match self {
            Self::Picture => 0,
            Self::Crop => 2,
            Self::Look => 4,
        }
    }

    /// The priority of the coarse first look, for which all else of a picture waits and which is soon over.
    pub(super) const fn first_look(self) -> i32 {
        self.priority() + 1
    }
}
