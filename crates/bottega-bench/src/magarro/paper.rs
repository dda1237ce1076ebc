//! Results printed in the paper (Gonzalez-Morcillo et al., MAGarRO, section 4), in seconds.

use bottega_farm::Optimization;

/// The numbers of agents in both tables.
pub(super) const AGENTS: [usize; 4] = [1, 2, 4, 8];

/// The levels of optimization of table 2.
pub(super) const OPTIMIZATIONS: [Optimization; 5] =
    [Optimization::VerySmall, Optimization::Small, Optimization::Normal, Optimization::Big, Optimization::VeryBig];

/// Without optimization, one machine: 121:17.
pub(super) const UNOPTIMIZED: f64 = time(121, 17);

/// Table 1, optimization n: by level of partition 1 to 3, then by number of agents.
pub(super) const TABLE_1: [[f64; 4]; 3] = [
    [time(92, 46), time(47, 21), time(26, 23), time(26, 25)],
    [time(82, 36), time(41, 13), time(23, 33), time(23, 31)],
    [time(105, 2), time(52, 41), time(26, 32), time(16, 52)],
];

/// Table 2, level 3: by optimization, then by number of agents.
pub(super) const TABLE_2: [[f64; 4]; 5] = [
    [time(125, 2), time(62, 36), time(31, 10), time(23, 43)],
    [time(110, 50), time(55, 54), time(27, 11), time(20, 54)],
    [time(105, 2), time(52, 41), time(26, 32), time(16, 52)],
    [time(85, 50), time(42, 55), time(22, 50), time(16, 18)],
    [time(85, 6), time(42, 40), time(22, 40), time(15, 58)],
];

/// The difference between vb and no optimization, and the noise included in it, in percent.
pub(super) const DIFFERENCE: (f64, f64) = (4.6, 1.2);

const fn time(minutes: u32, seconds: u32) -> f64 {
    (60 * minutes + seconds) as f64
}
