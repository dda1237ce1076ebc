//! `bottega devices`: what can take part in rendering.

use std::process::ExitCode;

use bottega::devices::processors;
use bottega_bench::{Report, devices::measure};
use bottega_gpu::{AdapterInfo, AdapterKind, GpuError};
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
    let measured = args.bench.then(|| measure(&names).map_err(CliError::from)).transpose()?;
    if args.json {
        let gpus = gpus.iter().map(|gpu| {
            let software = gpu.kind == AdapterKind::Software;
            json!({"name": gpu.name, "driver": gpu.driver, "backend": gpu.backend, "software": software})
        });
        let gpus: Vec<_> = gpus.collect();
        let costs = measured.as_ref().map(Report::as_json);
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
        print!("{}", measured.as_text());
    }
    Ok(ExitCode::SUCCESS)
}
