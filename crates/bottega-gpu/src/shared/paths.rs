//! Batches of paths: their parameters, the state of each path, and the counters of the kernels.

use bottega_image::Layout as PixelLayout;
use bottega_render::record;

use super::declare::{Layout, buffer_struct, constants};

pub(super) const LAYOUTS: &[Layout] = &[Layout::of::<JobRecord>("JOB")];

record! {
    /// A block of pixels of a batch.
    pub(crate) struct JobRecord {
        /// The first column and row.
        pub(crate) x: u32,
        pub(crate) y: u32,
        pub(crate) columns: u32,
        pub(crate) pixels: u32,
        pub(crate) first_sample: u32,
        /// The index of the block's first path in the batch.
        pub(crate) first_path: u32,
        /// The index of the block's first pixel in the sums.
        pub(crate) first_pixel: u32,
        pub(crate) paths: u32,
    }
}

buffer_struct! {
    /// The parameters of a batch.
    struct BatchParams {
        /// The seed, hashed.
        mixed_seed: [u32; 2],
        /// The maximum number of paths under way, and the number of paths of this pass.
        capacity: u32,
        path_count: u32,
        /// The index of the first path of this pass in the batch.
        first_path: u32,
        job_count: u32,
        pixel_count: u32,
        /// The places of the image and of the jobs in the batch's words.
        picture_at: u32,
        jobs_at: u32,
        max_depth: u32,
        roulette_depth: u32,
        light_samples: u32,
        /// The code of the strategy for direct light.
        direct_light: u32,
        /// Floats per pixel, of which the last counts dropped samples; and the offsets of albedo, normal and depth among them,
        /// NONE if not kept.
        stride: u32,
        albedo_at: u32,
        normal_at: u32,
        depth_at: u32,
        /// The bits of the maximum value of a channel of a sample.
        sample_max: u32,
    }
}

constants! {
    /// Constants of batches.
    CONSTANTS;
    /// Strategies for direct light: combined by MIS, light sampling only, or BSDF sampling only.
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

    /// Offsets in a pixel's sums.
    SUM_ALPHA: u32 = PixelLayout::ALPHA as u32;
    SUM_SQUARE: u32 = PixelLayout::LUMINANCE_SQUARED as u32;
    SUM_COUNT: u32 = PixelLayout::SAMPLE_COUNT as u32;

    // Fields of a path, each of them an array over all paths.
    /// Origin of the ray; width of its cone there.
    PATH_ORIGIN: u32 = 0;
    /// Direction of the ray; growth of the cone.
    PATH_DIRECTION: u32 = 1;
    /// Throughput; scale of Russian roulette.
    PATH_THROUGHPUT: u32 = 2;
    /// Radiance so far; pdf of the sampled direction, −1 if light sampling cannot find the next light.
    PATH_RADIANCE: u32 = 3;
    /// Point for which lights were sampled; 1 if an albedo is still to be recorded, else 0.
    PATH_RECEIVER: u32 = 4;
    /// Normal of the point in `PATH_RECEIVER`; weight of the sample.
    PATH_RECEIVER_NORMAL: u32 = 5;
    /// Absorption of the solid that the path is in.
    PATH_ABSORPTION: u32 = 6;
    /// Key of the pixel (two words); index of the sample.
    PATH_KEY: u32 = 7;
    /// The hit: t, u, v, number of the shape. Before the first hit: length of the ray, and its start's distance from the camera.
    PATH_HIT: u32 = 8;
    /// Albedo; alpha.
    PATH_ALBEDO: u32 = 9;
    /// Normal; depth. Before the first surface is shaded, depth is the distance of the ray's start from the camera.
    PATH_NORMAL: u32 = 10;
    /// The first of the fields of light samples: `SHADOW_FIELDS` for each.
    PATH_SHADOW: u32 = 11;
    /// Origin of the shadow ray; its end.
    SHADOW_ORIGIN: u32 = 0;
    /// Direction of the shadow ray.
    SHADOW_DIRECTION: u32 = 1;
    /// Radiance that the light sample adds if it is visible.
    SHADOW_BROUGHT: u32 = 2;
    SHADOW_FIELDS: u32 = 3;

    /// Queues, each with room for all paths. Active paths alternate between the first two.
    QUEUE_ACTIVE: u32 = 0;
    QUEUES_ACTIVE: u32 = 2;
    QUEUE_MISSED: u32 = 2;
    QUEUE_LIT: u32 = 3;
    QUEUE_MET: u32 = 4;
    QUEUES: u32 = 5;

    /// Counters of the kernels.
    CONTROL_DEPTH: u32 = 0;
    CONTROL_ACTIVE: u32 = 1;
    CONTROL_NEXT: u32 = 2;
    CONTROL_MISSED: u32 = 3;
    CONTROL_LIT: u32 = 4;
    CONTROL_LIT_NOW: u32 = 5;
    CONTROL_MET: u32 = 8;
    CONTROL_WORDS: u32 = 16;

    /// Dispatches that are planned on the device, three words each.
    GROUPS_EXTEND: u32 = 0;
    GROUPS_MISS: u32 = 1;
    GROUPS_SHADOW: u32 = 2;
    GROUPS_SHADE: u32 = 3;
    GROUPS_COUNT: u32 = 4;
    DISPATCH_WORDS: u32 = 3;
}
