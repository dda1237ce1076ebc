//! Results printed in the paper (Pereira et al., tables 1 and 2).

/// Seconds of one scene on one of the paper's machines: without the allocator, with it, with it and a GPU.
pub(super) struct PaperRow {
    pub(super) machine: &'static str,
    pub(super) scene: &'static str,
    pub(super) seconds: [f64; 3],
}

pub(super) const ROWS: [PaperRow; 4] = [
    PaperRow { machine: "PC1+GPU1", scene: "A", seconds: [201.13, 234.73, 163.19] },
    PaperRow { machine: "PC1+GPU1", scene: "B", seconds: [166.81, 188.71, 139.53] },
    PaperRow { machine: "PC2+GPU2", scene: "A", seconds: [154.99, 172.72, 123.00] },
    PaperRow { machine: "PC2+GPU2", scene: "B", seconds: [127.69, 149.40, 95.37] },
];

/// The number of rays per scene.
pub(super) const RAYS: f64 = 1e8;
