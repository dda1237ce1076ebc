//! A device that traces paths through the scenes in its memory.

use std::sync::Arc;

use bottega_hra::DataId;
use bottega_kernels::{Hit, Ray};
use wgpu::{Adapter, BindGroup, Buffer, BufferUsages, CommandEncoder, ComputePass, ComputePipeline, SubmissionIndex};

use super::batch::BlockBatch;
use super::kernels::{Kernels, Layouts, STORAGE_BUFFERS, Variant};
use super::options::PathOptions;
use super::resident::ResidentScenes;
use super::scene::PathScene;
use crate::adapter::AdapterInfo;
use crate::context::{Context, GROUPS_MAX, binding_limit};
use crate::error::GpuError;
use crate::pipeline_cache::{self, PipelineCache};
use crate::shared::geometry::GROUP_SIZE;
use crate::shared::paths::{
    BatchParams, CONTROL_ACTIVE, CONTROL_WORDS, DISPATCH_WORDS, GROUPS_COUNT, GROUPS_EXTEND, GROUPS_MISS, GROUPS_SHADE,
    GROUPS_SHADOW, PATH_SHADOW, QUEUES, SHADOW_FIELDS,
};

/// The size of a field of a path's state: a vector of four words.
const FIELD_BYTES: u64 = 16;
/// The size of an indirect dispatch, in bytes.
const DISPATCH_BYTES: u64 = 4 * DISPATCH_WORDS as u64;
/// The initial contents of the counters.
const CONTROL: [u32; CONTROL_WORDS as usize] = [0; CONTROL_WORDS as usize];
/// The index of the counter of active paths.
const ACTIVE: usize = CONTROL_ACTIVE as usize;
/// The maximum number of rays per batch of rays.
const RAYS_AT_ONCE: usize = 1 << 20;
/// The number of bounces per submission; after them the CPU checks whether any path is left.
const BOUNCES: u32 = 32;

/// The maximum number of batches on the device: one under way, one that waits or is read.
const SETS: usize = 2;

/// A batch on the device.
#[derive(Debug)]
pub(super) struct Flight {
    set: usize,
    submission: SubmissionIndex,
    sum_bytes: u64,
}

/// Buffers of a batch, grown as needed.
#[derive(Debug)]
struct Buffers {
    words: Buffer,
    sums: Buffer,
    readback: Buffer,
    /// The bound scene, and its bind group.
    scene: (DataId, BindGroup),
    state: BindGroup,
}

/// A device that traces paths; see the [module](self).
#[derive(Debug)]
pub(super) struct Tracer {
    context: Arc<Context>,
    cache: PipelineCache,
    layouts: Layouts,
    scenes: ResidentScenes,
    params: Buffer,
    state: Buffer,
    queues: Buffer,
    control: Buffer,
    groups: Buffer,
    left: Buffer,
    plan: BindGroup,
    buffers: [Option<Buffers>; SETS],
    /// The index of the buffer set that the next batch uses.
    turn: usize,
    state_bytes: u64,
    queue_paths: u64,
}

impl Tracer {
    /// Opens a device without scenes.
    ///
    /// - `options.paths`: the number of paths under way, if the device has the memory.
    pub(super) fn new(adapter: &Adapter, info: &AdapterInfo, options: &PathOptions) -> Result<Self, GpuError> {
        let features = pipeline_cache::features(adapter);
        let context = Context::open(adapter, info, STORAGE_BUFFERS, features, options.timeout)?;
        let context = Arc::new(context);
        let cache = PipelineCache::open(&context, adapter, options.cache.as_deref());
        let layouts = Layouts::new(&context);
        let limit = binding_limit(adapter);
        let paths = options.paths.clamp(1, u64::from(GROUP_SIZE * GROUPS_MAX));
        let state_bytes = (paths * fields(1) * FIELD_BYTES).min(limit / FIELD_BYTES * FIELD_BYTES);
        let queue_paths = paths.min(limit / (u64::from(QUEUES) * 4));
        let params =
            context.buffer("params", size_of::<BatchParams>() as u64, BufferUsages::UNIFORM | BufferUsages::COPY_DST);
        let state = context.buffer("state", state_bytes, BufferUsages::STORAGE);
        let queues = context.buffer("queues", queue_paths * u64::from(QUEUES) * 4, BufferUsages::STORAGE);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        let control = context.buffer("control", size_of_val(&CONTROL) as u64, usage);
        let groups = context.buffer(
            "groups",
            DISPATCH_BYTES * u64::from(GROUPS_COUNT),
            BufferUsages::STORAGE | BufferUsages::INDIRECT,
        );
        let left = context.buffer("left", 4, BufferUsages::MAP_READ | BufferUsages::COPY_DST);
        let plan = context.bind("plan", &layouts.plan, &[(0, &control), (1, &groups)]);
        context.check()?;
        Ok(Self {
            context,
            cache,
            layouts,
            scenes: ResidentScenes::new(options.memory),
            params,
            state,
            queues,
            control,
            groups,
            left,
            plan,
            buffers: [const { None }; SETS],
            turn: 0,
            state_bytes,
            queue_paths,
        })
    }

    /// Compiles the kernels of a variant, unless that is done.
    pub(super) fn compile(&mut self, variant: Variant) -> Result<(), GpuError> {
        self.scenes.kernels(&self.context, &self.layouts, &self.cache, variant).map(|_| ())
    }

    /// Returns true if the kernels of a variant are compiled.
    pub(super) fn has_kernels(&self, variant: Variant) -> bool {
        self.scenes.has_kernels(variant)
    }

    /// Runs `work` without timeouts of the device.
    pub(super) fn patiently<R>(&mut self, work: impl FnOnce(&mut Self) -> R) -> R {
        self.context.set_patient(true);
        let done = work(self);
        self.context.set_patient(false);
        done
    }

    /// Uploads a scene, unless it is on the device.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`]: the scene does not fit; the device is unchanged.
    pub(super) fn admit(&mut self, id: DataId, flat: &PathScene) -> Result<(), GpuError> {
        self.scenes.admit(&self.context, &self.layouts, &self.cache, id, flat)
    }

    /// Removes a scene from the device's memory.
    pub(super) fn evict(&mut self, id: DataId) {
        for buffers in &mut self.buffers {
            // A bind group keeps its buffers alive.
            if buffers.as_ref().is_some_and(|buffers| buffers.scene.0 == id) {
                *buffers = None;
            }
        }
        self.scenes.evict(id);
    }

    /// Returns the bytes uploaded since the last call, and the bytes on the device.
    pub(super) fn scene_bytes(&mut self) -> (u64, u64) {
        self.scenes.bytes()
    }

    /// Returns the closest hit of each ray in an admitted scene.
    pub(super) fn intersect(&mut self, id: DataId, rays: &[Ray]) -> Result<Vec<Hit>, GpuError> {
        self.scenes.get(id).ok_or_else(not_there)?.rays(&self.context).intersect(rays, RAYS_AT_ONCE)
    }

    /// Returns `true` for each ray that hits anything in an admitted scene.
    pub(super) fn occluded(&mut self, id: DataId, rays: &[Ray]) -> Result<Vec<bool>, GpuError> {
        self.scenes.get(id).ok_or_else(not_there)?.rays(&self.context).occluded(rays, RAYS_AT_ONCE)
    }

    /// Returns the maximum number of paths under way.
    pub(super) fn capacity(&self, light_samples: u32) -> u64 {
        let bytes = fields(light_samples) * FIELD_BYTES;
        (self.state_bytes / bytes).min(self.queue_paths)
    }

    /// Starts a batch of an admitted scene. At most two batches are on the device; they finish in order.
    pub(super) fn start(&mut self, id: DataId, batch: &BlockBatch) -> Result<Flight, GpuError> {
        self.context.check()?;
        let kernels = Arc::clone(&self.scenes.get(id).ok_or_else(not_there)?.kernels);
        let capacity = self.capacity(batch.params.light_samples).min(u64::from(batch.path_count)) as u32;
        if capacity == 0 && batch.path_count != 0 {
            return Err(GpuError::Invalid(format!("{} light samples at a vertex", batch.params.light_samples)));
        }
        // Upload the batch, and clear its sums.
        let sum_bytes = (batch.sums() * size_of::<f32>()) as u64;
        let set = self.turn;
        self.turn = (set + 1) % SETS;
        self.grow(set, id, size_of_val(&*batch.words) as u64, sum_bytes)?;
        let Some(buffers) = &self.buffers[set] else { return Err(GpuError::Invalid("no buffers".to_owned())) };
        self.context.queue.write_buffer(&buffers.words, 0, bytemuck::cast_slice(&batch.words));
        let mut encoder = self.encoder();
        encoder.clear_buffer(&buffers.sums, 0, Some(sum_bytes));
        self.context.queue.submit([encoder.finish()]);
        // Trace the paths in passes that fit into memory.
        let mut before = None;
        for first_path in (0..batch.path_count).step_by(capacity.max(1) as usize) {
            let path_count = capacity.min(batch.path_count - first_path);
            let params = BatchParams { capacity, first_path, path_count, ..batch.params };
            let submission = self.pass(&kernels, &params, buffers)?;
            // One pass is under way while the next is prepared, so that a wait covers at most two passes.
            if let Some(before) = before.replace(submission) {
                self.context.wait(&before)?;
            }
        }
        // Copy the sums to the readback buffer.
        let mut encoder = self.encoder();
        encoder.copy_buffer_to_buffer(&buffers.sums, 0, &buffers.readback, 0, sum_bytes);
        let submission = self.context.queue.submit([encoder.finish()]);
        Ok(Flight { set, submission, sum_bytes })
    }

    /// Waits for a batch; `read` gets the sums of its pixels.
    pub(super) fn finish(&mut self, flight: Flight, read: impl FnOnce(&[u32])) -> Result<(), GpuError> {
        let Flight { set, submission, sum_bytes } = flight;
        let Some(buffers) = &self.buffers[set] else { return Err(not_there()) };
        self.context.read(&submission, &buffers.readback, sum_bytes, read)
    }

    fn encoder(&self) -> CommandEncoder {
        self.context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Traces as many paths as fit, and adds their results to the sums.
    fn pass(&self, kernels: &Kernels, params: &BatchParams, buffers: &Buffers) -> Result<SubmissionIndex, GpuError> {
        let queue = &self.context.queue;
        // Upload the parameters, and generate camera rays.
        let mut control = CONTROL;
        control[ACTIVE] = params.path_count;
        queue.write_buffer(&self.params, 0, bytemuck::bytes_of(params));
        queue.write_buffer(&self.control, 0, bytemuck::cast_slice(&control));
        let mut encoder = self.encoder();
        self.compute(&mut encoder, buffers, |pass| {
            pass.set_pipeline(&kernels.generate);
            pass.dispatch_workgroups(params.path_count.div_ceil(GROUP_SIZE), 1, 1);
            self.plan(pass, buffers, &kernels.plan_extend);
        });
        // Trace bounces until no path is left.
        let mut depth = 0;
        loop {
            let bounces = BOUNCES.min(params.max_depth - depth);
            self.compute(&mut encoder, buffers, |pass| {
                for _ in 0..=bounces {
                    self.bounce(kernels, pass, buffers);
                }
            });
            if params.max_depth - depth <= bounces {
                break;
            }
            depth += bounces + 1;
            // Check for remaining paths.
            encoder.copy_buffer_to_buffer(&self.control, 4 * ACTIVE as u64, &self.left, 0, 4);
            let submission = queue.submit([encoder.finish()]);
            let mut left = 0;
            self.context.read(&submission, &self.left, 4, |words| left = words[0])?;
            encoder = self.encoder();
            if left == 0 {
                break;
            }
        }
        // Add the results to the sums.
        self.compute(&mut encoder, buffers, |pass| {
            pass.set_pipeline(&kernels.accumulate);
            pass.dispatch_workgroups(params.pixel_count.div_ceil(GROUP_SIZE), 1, 1);
        });
        Ok(queue.submit([encoder.finish()]))
    }

    fn compute(&self, encoder: &mut CommandEncoder, buffers: &Buffers, record: impl FnOnce(&mut ComputePass<'_>)) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        set_groups(&mut pass, buffers);
        record(&mut pass);
    }

    /// Traces one bounce: all active paths find their next surface and scatter there.
    fn bounce(&self, kernels: &Kernels, pass: &mut ComputePass<'_>, buffers: &Buffers) {
        self.planned(pass, &kernels.extend, GROUPS_EXTEND);
        self.plan(pass, buffers, &kernels.plan_shade);
        self.planned(pass, &kernels.miss, GROUPS_MISS);
        self.planned(pass, &kernels.shade, GROUPS_SHADE);
        self.plan(pass, buffers, &kernels.plan_next);
        self.planned(pass, &kernels.shadow, GROUPS_SHADOW);
    }

    /// Dispatches a kernel with the number of threads planned for it.
    fn planned(&self, pass: &mut ComputePass<'_>, pipeline: &ComputePipeline, place: u32) {
        pass.set_pipeline(pipeline);
        pass.dispatch_workgroups_indirect(&self.groups, DISPATCH_BYTES * u64::from(place));
    }

    fn plan(&self, pass: &mut ComputePass<'_>, buffers: &Buffers, pipeline: &ComputePipeline) {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &self.plan, &[]);
        pass.dispatch_workgroups(1, 1, 1);
        set_groups(pass, buffers);
    }

    /// Grows the buffers for a batch, and binds its scene.
    fn grow(&mut self, set: usize, id: DataId, word_bytes: u64, sum_bytes: u64) -> Result<(), GpuError> {
        let old = self.buffers[set].take();
        let is_enough = |it: &Buffers| it.words.size() >= word_bytes && it.sums.size() >= sum_bytes;
        let (words, sums, readback, bound) = match old {
            Some(it) if is_enough(&it) && it.scene.0 == id => {
                self.buffers[set] = Some(it);
                return Ok(());
            }
            Some(it) if is_enough(&it) => (it.words, it.sums, it.readback, Some(it.state)),
            old => {
                let (old_words, old_sums) = old.as_ref().map_or((0, 0), |it| (it.words.size(), it.sums.size()));
                drop(old); // Free the old buffers first, in case memory is short.
                let context = &self.context;
                let size = |wanted: u64, old: u64| wanted.max(old).max(1 << 16).next_power_of_two();
                let (word_bytes, sum_bytes) = (size(word_bytes, old_words), size(sum_bytes, old_sums));
                let words = context.buffer("batch", word_bytes, BufferUsages::STORAGE | BufferUsages::COPY_DST);
                let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
                let sums = context.buffer("sums", sum_bytes, usage);
                let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
                let readback = context.buffer("readback", sum_bytes, usage);
                (words, sums, readback, None)
            }
        };
        let context = &self.context;
        let arrays = &self.scenes.get(id).ok_or_else(not_there)?.arrays;
        let [nodes, shapes, scene, materials, textures] = arrays.each_ref().map(|array| &**array);
        let read = [nodes, shapes, scene, &words, materials, textures, &self.params];
        let read: Vec<_> = (0..).zip(read).collect();
        let scene = context.bind("scene", &self.layouts.scene, &read);
        let state = bound.unwrap_or_else(|| {
            let written: Vec<_> = (0..).zip([&self.state, &self.queues, &self.control, &sums]).collect();
            context.bind("state", &self.layouts.state, &written)
        });
        self.buffers[set] = Some(Buffers { words, sums, readback, scene: (id, scene), state });
        Ok(())
    }

    /// Destroys the device, like a driver that resets it.
    #[cfg(test)]
    pub(super) fn lose(&self) {
        self.context.device.destroy();
    }
}

fn not_there() -> GpuError {
    GpuError::Invalid("the scene is not on the device".to_owned())
}

/// Returns the number of fields of a path's state, including its light samples.
fn fields(light_samples: u32) -> u64 {
    u64::from(PATH_SHADOW) + u64::from(SHADOW_FIELDS) * u64::from(light_samples)
}

fn set_groups(pass: &mut ComputePass<'_>, buffers: &Buffers) {
    pass.set_bind_group(0, &buffers.scene.1, &[]);
    pass.set_bind_group(1, &buffers.state, &[]);
}
