//! `bottega devices`: lists the devices that can render.

use std::process::ExitCode;

use bottega::devices::{DeviceCosts, measure, processors};
use bottega_gpu::{AdapterInfo, AdapterKind, GpuError};
use serde_json::json;

use crate::{cli::DevicesArgs, error::CliError};

pub(crate) fn run(args: &DevicesArgs) -> Result<ExitCode, CliError> {
    let gpus = bottega_gpu::adapters();
    // Software adapters are measured only when selected by name.
    let is_meant = |gpu: &&AdapterInfo| match &args.gpu {
        Some(name) => gpu.name.to_lowercase().contains(&name.to_lowercase()),
        None => gpu.kind != AdapterKind::Software,
    };
    let names: Vec<String> = gpus.iter().filter(is_meant).map(|gpu| gpu.name.clone()).collect();
    if let (Some(wanted), true) = (&args.gpu, names.is_empty()) {
        let found = gpus.iter().map(|gpu| gpu.name.clone()).collect();
        return Err(GpuError::UnknownAdapter { wanted: wanted.clone(), found }.into());
    }
    let measured = args.bench.then(|| measure(&names)).transpose()?;
    if args.json {
        let gpus = gpus.iter().map(|gpu| {
            let software = gpu.kind == AdapterKind::Software;
            json!({"name": gpu.name, "driver": gpu.driver, "backend": gpu.backend, "software": software})
        });
        let gpus: Vec<_> = gpus.collect();
        println!("{}", json!({"processors": processors(), "gpus": gpus, "costs": measured}));
        return Ok(ExitCode::SUCCESS);
    }
    println!("{} processors", processors());
    for gpu in &gpus {
        let note = if gpu.kind == AdapterKind::Software { "; software: used only if named" } else { "" };
        println!("{} ({}, {}{note})", gpu.name, gpu.backend, gpu.driver);
    }
    if gpus.is_empty() {
        println!("no GPU: there is no Vulkan driver, or it finds none");
    }
    measured.iter().flatten().for_each(print_costs);
    Ok(ExitCode::SUCCESS)
}

fn print_costs(device: &DeviceCosts) {
    print!("\n{}\n", bottega_image::printable(&device.name));
    let of_all = if device.count > 1 { format!(" by all {}", device.count) } else { String::new() };
    for cost in &device.primitives {
        println!(
            "  {:<12} {:9.3} million a second; a unit costs {:7.1} us and {:8.2} ns an item; would do {:.1} %{of_all}",
            cost.primitive,
            cost.items_per_second / 1e6,
            cost.unit_ns / 1e3,
            cost.item_ns,
            100.0 * cost.share,
        );
    }
    device.notes.iter().for_each(|note| println!("  {note}"));
}
