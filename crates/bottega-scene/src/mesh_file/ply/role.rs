//! The meaning of vertex properties.

/// The meaning of a vertex property, with the index of its component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Position(usize),
    Normal(usize),
    Uv(usize),
    Color(usize),
}

impl Role {
    /// Returns the role of a property name used by exporters; `None`: the name is unknown.
    pub(super) fn new(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"x" => Self::Position(0),
            b"y" => Self::Position(1),
            b"z" => Self::Position(2),
            b"nx" | b"normal_x" => Self::Normal(0),
            b"ny" | b"normal_y" => Self::Normal(1),
            b"nz" | b"normal_z" => Self::Normal(2),
            b"u" | b"s" | b"u0" | b"u1" | b"texture_u" | b"texture_s" | b"tx" => Self::Uv(0),
            b"v" | b"t" | b"v0" | b"v1" | b"texture_v" | b"texture_t" | b"ty" => Self::Uv(1),
            b"red" | b"r" | b"diffuse_red" => Self::Color(0),
            b"green" | b"g" | b"diffuse_green" => Self::Color(1),
            b"blue" | b"b" | b"diffuse_blue" => Self::Color(2),
            b"alpha" | b"a" | b"diffuse_alpha" => Self::Color(3),
            _ => return None,
        })
    }
}
