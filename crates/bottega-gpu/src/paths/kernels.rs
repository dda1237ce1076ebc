//! The kernels of path tracing: their sources, layouts and pipelines.

use wgpu::{BindGroupLayout, BufferBindingType, ComputePipeline, PipelineCache, ShaderModule};

use crate::context::{Context, storage};
use crate::material::{self, Features};
use crate::{shared, traversal};

/// The number of storage arrays that a kernel binds.
pub(super) const STORAGE_BUFFERS: u32 = 10;

const MATH: &str = include_str!("../wgsl/math.wgsl");
/// The source shared by all kernels except the planner.
const COMMON: &str = concat!(
    include_str!("../wgsl/scene_words.wgsl"),
    include_str!("../wgsl/functions.wgsl"),
    include_str!("../wgsl/state.wgsl"),
    include_str!("../wgsl/sampler.wgsl"),
);
const SURFACES: &str = concat!(include_str!("../wgsl/shapes.wgsl"), include_str!("../wgsl/places.wgsl"));
const CAMERA: &str = concat!(
    include_str!("../wgsl/sampling.wgsl"),
    include_str!("../wgsl/camera.wgsl"),
    include_str!("../wgsl/filter.wgsl"),
    include_str!("../wgsl/generate.wgsl"),
    include_str!("../wgsl/accumulate.wgsl"),
);
const TRAVERSAL: &str = include_str!("../wgsl/extend.wgsl");
const SHADING: &str = concat!(
    include_str!("../wgsl/sampling.wgsl"),
    include_str!("../wgsl/interaction/mesh.wgsl"),
    include_str!("../wgsl/interaction.wgsl"),
    include_str!("../wgsl/lights/rectangle.wgsl"),
    include_str!("../wgsl/lights/triangle.wgsl"),
    include_str!("../wgsl/lights/sphere.wgsl"),
    include_str!("../wgsl/lights/panel.wgsl"),
    include_str!("../wgsl/lights/surface.wgsl"),
    include_str!("../wgsl/lights/punctual.wgsl"),
    include_str!("../wgsl/lights/distribution.wgsl"),
    include_str!("../wgsl/lights/environment.wgsl"),
    include_str!("../wgsl/lights/tree.wgsl"),
    include_str!("../wgsl/lights/mod.wgsl"),
    include_str!("../wgsl/integrator/path/light.wgsl"),
    include_str!("../wgsl/integrator/path.wgsl"),
);
const PLAN: &str = include_str!("../wgsl/plan.wgsl");

/// The properties that kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Variant {
    /// `true`: some surface may let rays pass.
    pub(super) has_opacity: bool,
    /// The features that the scene's surfaces use.
    pub(super) features: Features,
    /// The number of node groups on a ray's stack.
    pub(super) stack_size: u32,
}

/// Returns the source of the kernels that start and end paths.
pub(super) fn camera_source() -> String {
    [shared::source(), MATH, COMMON, CAMERA].concat()
}

/// Returns the source of the kernels that trace rays.
pub(super) fn traversal_source(variant: Variant) -> String {
    let traverse = traversal::source(variant.stack_size);
    if variant.has_opacity {
        let materials = material::source(Features::TEXTURES);
        [shared::source(), &materials, COMMON, SURFACES, include_str!("../wgsl/cut_out.wgsl"), &traverse, TRAVERSAL]
            .concat()
    } else {
        let shapes = include_str!("../wgsl/shapes.wgsl");
        [shared::source(), MATH, COMMON, shapes, include_str!("../wgsl/all_there.wgsl"), &traverse, TRAVERSAL].concat()
    }
}

/// Returns the source of the kernels that sample lights and scatter.
pub(super) fn shading_source(variant: Variant) -> String {
    [shared::source(), &material::source(variant.features), COMMON, SURFACES, SHADING].concat()
}

/// Returns the source of the kernels that plan dispatches.
pub(super) fn plan_source() -> String {
    [shared::source(), PLAN].concat()
}

/// The bind group layouts, shared by all variants.
#[derive(Debug)]
pub(super) struct Layouts {
    /// The scene and the batch, read only.
    pub(super) scene: BindGroupLayout,
    /// The buffers that kernels write.
    pub(super) state: BindGroupLayout,
    pub(super) plan: BindGroupLayout,
}

impl Layouts {
    pub(super) fn new(context: &Context) -> Self {
        let read = storage(true);
        let scene: Vec<_> = (0..6).map(|at| (at, read)).chain([(6, BufferBindingType::Uniform)]).collect();
        let written: Vec<_> = (0..4).map(|at| (at, storage(false))).collect();
        Self {
            scene: context.layout("scene", &scene),
            state: context.layout("state", &written),
            plan: context.layout("plan", &written[..2]),
        }
    }
}

/// All pipelines of a variant.
#[derive(Debug)]
pub(super) struct Kernels {
    pub(super) generate: ComputePipeline,
    pub(super) accumulate: ComputePipeline,
    pub(super) extend: ComputePipeline,
    pub(super) shadow: ComputePipeline,
    pub(super) miss: ComputePipeline,
    pub(super) shade: ComputePipeline,
    pub(super) plan_extend: ComputePipeline,
    pub(super) plan_shade: ComputePipeline,
    pub(super) plan_next: ComputePipeline,
}

impl Kernels {
    pub(super) fn new(context: &Context, layouts: &Layouts, variant: Variant, cache: Option<&PipelineCache>) -> Self {
        let compiler = KernelCompiler { context, cache };
        let paths = compiler.layout("paths", &[&layouts.scene, &layouts.state]);
        let plan = compiler.layout("plan", &[&layouts.plan]);
        let [generate, accumulate] =
            compiler.pipelines(&compiler.module(&camera_source()), &paths, ["generate", "accumulate"]);
        // Kernels that read materials and textures, which come from files, keep their bounds checks.
        let source = traversal_source(variant);
        let unguarded = || traversal::module(&context.device, "traversal", &source);
        let traversal = if variant.has_opacity { compiler.module(&source) } else { unguarded() };
        let [extend, shadow] = compiler.pipelines(&traversal, &paths, ["extend", "shadow"]);
        let [miss, shade] = compiler.pipelines(&compiler.module(&shading_source(variant)), &paths, ["miss", "shade"]);
        let [plan_extend, plan_shade, plan_next] =
            compiler.pipelines(&compiler.module(&plan_source()), &plan, ["plan_extend", "plan_shade", "plan_next"]);
        Self { generate, accumulate, extend, shadow, miss, shade, plan_extend, plan_shade, plan_next }
    }
}

/// Compiles pipelines on a device, with its cache.
struct KernelCompiler<'a> {
    context: &'a Context,
    cache: Option<&'a PipelineCache>,
}

impl KernelCompiler<'_> {
    fn layout(&self, label: &str, groups: &[&BindGroupLayout]) -> wgpu::PipelineLayout {
        let groups: Vec<_> = groups.iter().map(|&group| Some(group)).collect();
        self.context.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: &groups,
            immediate_size: 0,
        })
    }

    fn module(&self, source: &str) -> ShaderModule {
        let source = wgpu::ShaderSource::Wgsl(source.into());
        self.context.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source })
    }

    fn pipelines<const N: usize>(
        &self,
        module: &ShaderModule,
        layout: &wgpu::PipelineLayout,
        entry_points: [&str; N],
    ) -> [ComputePipeline; N] {
        entry_points.map(|entry_point| {
            self.context.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(entry_point),
                layout: Some(layout),
                module,
                entry_point: Some(entry_point),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: self.cache,
            })
        })
    }
}
