//! `bottega devices`: what can take part in rendering.

pub(crate) mod bench;

use std::process::ExitCode;

use bottega::devices::processors;
use bottega_gpu::{AdapterInfo, AdapterKind, GpuError, GpuOptions, GpuRays};
use bottega_hra::Resource;
use bottega_render::RenderWork;
use bottega_scene::Scene;
use serde_json::json;

use crate::{cli::DevicesArgs, error::CliError};

pub(crate) fn run(args: &DevicesArgs) -> Result<ExitCode, CliError> {
    let gpus = bottega_gpu::adapters();
    // Software is measured where it was asked for by name, as it paints.
    let is_meant = |gpu: &&AdapterInfo| match &args.gpu {
        Some(name) => gpu.name.to_lowercase().contains(&name.to_lowercase()),
        None => gpu.kind != AdapterKind::Software,
    };
    let names: Vec<String> = gpus.iter().filter(is_meant).map(|gpu| gpu.name.clone()).collect();
    if let (Some(wanted), true) = (&args.gpu, names.is_empty()) {
        let found = gpus.iter().map(|gpu| gpu.name.clone()).collect();
        return Err(GpuError::UnknownAdapter { wanted: wanted.clone(), found }.into());
    }
    let measured = args.bench.then(|| bench::measure(&names)).transpose()?;
    if args.json {
        let gpus = gpus.iter().map(|gpu| {
            let software = gpu.kind == AdapterKind::Software;
            json!({"name": gpu.name, "driver": gpu.driver, "backend": gpu.backend, "software": software})
        });
        let gpus: Vec<_> = gpus.collect();
        let costs = measured.as_deref().map(bench::as_json);
        println!("{}", json!({"processors": processors(), "gpus": gpus, "costs": costs}));
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
    if let Some(measured) = measured {
        print!("{}", bench::as_text(&measured));
    }
    Ok(ExitCode::SUCCESS)
}

/// The GPU that was asked for, with the triangles of the scene on it: it answers batches of rays.
pub(crate) fn gpu(name: Option<&str>, scene: &Scene) -> Result<Vec<Box<dyn Resource<RenderWork>>>, CliError> {
    let Some(name) = name else { return Ok(Vec::new()) };
    let options = GpuOptions { adapter: Some(name.to_owned()), ..GpuOptions::default() };
    Ok(vec![Box::new(GpuRays::new(scene, &options)?)])
}
