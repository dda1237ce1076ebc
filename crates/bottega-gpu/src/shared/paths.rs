//! Batches of paths: what is told of them, what is kept of each, and what kernels count.

use bottega_image::Layout as PixelLayout;
use bottega_render::record;

use super::declare::{Layout, buffer_struct, constants};

pub(super) const LAYOUTS: &[Layout] = &[Layout::of::<JobRecord>("JOB")];

record! {
    /// A block of pixels of a batch.
    pub(crate) struct JobRecord {
        /// First column and row.
        pub(crate) x: u32,
        pub(crate) y: u32,
        pub(crate) columns: u32,
        pub(crate) pixels: u32,
        pub(crate) first_sample: u32,
        /// Of the batch.
        pub(crate) first_path: u32,
        /// Of the sums.
        pub(crate) first_pixel: u32,
        pub(crate) paths: u32,
    }
}

buffer_struct! {
    /// What is told of a batch.
    struct BatchParams {
        /// Of the seed.
        mixed_seed: [u32; 2],
        /// Paths that there is room for, and those of this pass.
        capacity: u32,
        path_count: u32,
        /// Number of the first path of this pass among all of the batch.
        first_path: u32,
        job_count: u32,
        pixel_count: u32,
        /// Place of the picture and of the jobs among the batch's words.
        picture_at: u32,
        jobs_at: u32,
        max_depth: u32,
        roulette_depth: u32,
        light_samples: u32,
        /// Code of the strategy.
        direct_light: u32,
        /// Floats of a pixel, the last of them counting samples that were dropped, and where the values beside radiance are among
        /// them; NONE: not kept.
        stride: u32,
        albedo_at: u32,
        normal_at: u32,
        depth_at: u32,
        /// The bits of the greatest value that a channel of a sample may have.
        sample_max: u32,
    }
}

constants! {
    /// Of batches.
    CONSTANTS;
    /// Lights are found by both strategies.
    DIRECT_COMBINED: u32 = 0;
    DIRECT_LIGHT_SAMPLING: u32 = 1;
    DIRECT_BSDF_SAMPLING: u32 = 2;

    /// The table of the Sobol' sequence, at the front of the batch's words: groups of bits of an index,
    SOBOL_GROUPS: u32 = 8;
    /// bits of a group,
    SOBOL_BITS: u32 = 4;
    /// values of a group,
    SOBOL_VALUES: u32 = 1 << SOBOL_BITS;
    /// and dimensions.
    SOBOL_DIMENSIONS: u32 = 4;

    /// Places of a pixel's sums.
    SUM_ALPHA: u32 = PixelLayout::ALPHA as u32;
    SUM_SQUARE: u32 = PixelLayout::LUMINANCE_SQUARED as u32;
    SUM_COUNT: u32 = PixelLayout::SAMPLE_COUNT as u32;

    // Fields of a path, each of them an array over all paths.
    /// Where the ray begins, and the width of its cone there.
    PATH_ORIGIN: u32 = 0;
    /// Where it goes, and the growth of the cone.
    PATH_DIRECTION: u32 = 1;
    /// What the path still carries, and the scale of its roulette.
    PATH_THROUGHPUT: u32 = 2;
    /// What it found, and the density of the direction taken; −1: light sampling could not have found what comes.
    PATH_RADIANCE: u32 = 3;
    /// Point for which lights were sampled; whether an albedo is still wanted (0 or 1).
    PATH_RECEIVER: u32 = 4;
    /// Its normal; the factor with which the sample counts.
    PATH_RECEIVER_NORMAL: u32 = 5;
    /// Absorption of the solid that the path is in.
    PATH_ABSORPTION: u32 = 6;
    /// Key of the pixel (two words), index of the sample.
    PATH_KEY: u32 = 7;
    /// The hit: t, u, v, number of the shape. Before the first one: how far the ray reaches, and how far from the camera it starts.
    PATH_HIT: u32 = 8;
    /// Albedo, alpha.
    PATH_ALBEDO: u32 = 9;
    /// Normal, depth; before the first surface is shaded, how far from the camera the ray starts.
    PATH_NORMAL: u32 = 10;
    /// From here on, for each light sample, what follows.
    PATH_SHADOW: u32 = 11;
    /// Origin of the shadow ray and its end.
    SHADOW_ORIGIN: u32 = 0;
    /// Its direction.
    SHADOW_DIRECTION: u32 = 1;
    /// What it brings.
    SHADOW_BROUGHT: u32 = 2;
    SHADOW_FIELDS: u32 = 3;

    /// Queues, each as long as there is room for paths. Paths under way are in the first or the second by turns.
    QUEUE_ACTIVE: u32 = 0;
    QUEUES_ACTIVE: u32 = 2;
    QUEUE_MISSED: u32 = 2;
    QUEUE_LIT: u32 = 3;
    QUEUE_MET: u32 = 4;
    QUEUES: u32 = 5;

    /// Words in which kernels count.
    CONTROL_DEPTH: u32 = 0;
    CONTROL_ACTIVE: u32 = 1;
    CONTROL_NEXT: u32 = 2;
    CONTROL_MISSED: u32 = 3;
    CONTROL_LIT: u32 = 4;
    CONTROL_LIT_NOW: u32 = 5;
    CONTROL_MET: u32 = 8;
    CONTROL_WORDS: u32 = 16;

    /// Dispatches that are planned on the device, of three words each.
    GROUPS_EXTEND: u32 = 0;
    GROUPS_MISS: u32 = 1;
    GROUPS_SHADOW: u32 = 2;
    GROUPS_SHADE: u32 = 3;
    GROUPS_COUNT: u32 = 4;
    DISPATCH_WORDS: u32 = 3;
}
