//! `bottega devices`: what can take part in rendering.

use std::{process::ExitCode, thread};

use bottega_gpu::{AdapterKind, GpuOptions, GpuRays};
use bottega_hra::Resource;
use bottega_render::RenderWork;
use bottega_scene::Scene;
use serde_json::json;

use crate::{cli::DevicesArgs, error::CliError};

pub(crate) fn run(args: &DevicesArgs) -> Result<ExitCode, CliError> {
    let gpus = bottega_gpu::adapters();
    if args.json {
        let gpus: Vec<_> = gpus
            .iter()
            .map(|gpu| {
                let software = gpu.kind == AdapterKind::Software;
                json!({"name": gpu.name, "driver": gpu.driver, "backend": gpu.backend, "software": software})
            })
            .collect();
        println!("{}", json!({"processors": processors(), "gpus": gpus}));
        return Ok(ExitCode::SUCCESS);
    }
    println!("{} processors", processors());
    for gpu in &gpus {
        let note =
            if gpu.kind == AdapterKind::Software { "; software: takes part only when asked for by name" } else { "" };
        println!("{} ({}, {}{note})", gpu.name, gpu.backend, gpu.driver);
    }
    if gpus.is_empty() {
        println!("no GPU: there is no Vulkan driver, or it knows none");
    }
    Ok(ExitCode::SUCCESS)
}

/// Processors that this process may use.
pub(crate) fn processors() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// The GPU that was asked for, with the scene on it.
pub(crate) fn gpu(name: Option<&str>, scene: &Scene) -> Result<Vec<Box<dyn Resource<RenderWork>>>, CliError> {
    let Some(name) = name else { return Ok(Vec::new()) };
    let options = GpuOptions { adapter: Some(name.to_owned()), ..GpuOptions::default() };
    Ok(vec![Box::new(GpuRays::new(scene, &options)?)])
}
