// Words of `control`, in which the kernels of paths count.
const DEPTH: u32 = 0u;
const ACTIVE: u32 = 1u;
const NEXT: u32 = 2u;
const MISSED: u32 = 3u;
const LIT: u32 = 4u;
const LIT_NOW: u32 = 5u;
// One for each class of materials.
const MET: u32 = 8u;
