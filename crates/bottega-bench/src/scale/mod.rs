//! Scaling: time and memory over triangles, lights, textures, pixels, samples, zones and agents, with the expected law beside
//! the measured one.

mod axes;
mod curve;
mod plot;
mod render;

use std::{fmt::Write as _, io::Write, path::PathBuf};

use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use self::{
    axes::GrowthAxis,
    curve::{Curve, Point},
};
use crate::{
    error::Error,
    files::{create_folder, write_file},
    report::{Measurement, Report, headed, say},
};

/// Time and memory over the size of the work: triangles, lights, textures, pixels, samples, zones, simulated agents.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "For example:\n  bottega-bench scale -o scale/\n  bottega-bench scale --axis triangles,lights --small"
)]
pub(crate) struct ScaleOptions {
    /// The quantities that grow, separated by commas; default: all.
    #[arg(long = "axis", value_name = "AXIS", value_delimiter = ',')]
    axes: Vec<GrowthAxis>,
    /// Leave out the largest sizes: some seconds instead of minutes.
    #[arg(long)]
    small: bool,
    /// The number of threads; default: all processors.
    #[arg(long, value_name = "N")]
    threads: Option<u16>,
    /// The folder for `scale.svg` and `scale.json`.
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

/// All curves.
#[derive(Clone, Debug)]
struct ScaleReport {
    curves: Vec<Curve>,
}

impl Measurement for ScaleOptions {
    fn measure(&self, log: &mut dyn Write) -> Result<Box<dyn Report>, Error> {
        let axes = if self.axes.is_empty() { GrowthAxis::value_variants().to_vec() } else { self.axes.clone() };
        let threads = crate::arguments::threads(self.threads);
        let mut curves = Vec::new();
        for axis in axes {
            let mut of_axis: Vec<Curve> = axis.quantities().iter().map(|quantity| quantity.curve(axis)).collect();
            for size in axis.sizes(self.small) {
                say(log, format_args!("{size} {}", axis.word()));
                let values = axis.measure(size, threads)?;
                of_axis.iter_mut().zip(values).for_each(|(curve, value)| curve.points.push(Point { size, value }));
            }
            of_axis.iter_mut().for_each(Curve::fit);
            curves.extend(of_axis);
        }
        let report = ScaleReport { curves };
        if let Some(folder) = &self.output {
            create_folder(folder)?;
            write_file(&folder.join("scale.svg"), &plot::svg(&report.curves))?;
            write_file(&folder.join("scale.json"), &headed(&report).to_string())?;
        }
        Ok(Box::new(report))
    }
}

impl Report for ScaleReport {
    fn as_text(&self) -> String {
        let mut text = String::new();
        for curve in &self.curves {
            let measured = curve.exponent.map_or("?".to_owned(), |exponent| format!("{exponent:.2}"));
            let [low, high] = curve.expected;
            let verdict = match curve.exponent {
                Some(exponent) if exponent > high => "  ABOVE THE LAW",
                _ => "",
            };
            // Writing to a string cannot fail.
            _ = writeln!(
                text,
                "{}: {}\n  expected {} (exponent {low:.2} to {high:.2}), measured {measured}{verdict}",
                curve.axis, curve.quantity, curve.law
            );
            for point in &curve.points {
                _ = writeln!(text, "  {:>10} {:>14.6}", point.size, point.value);
            }
        }
        text
    }

    fn as_json(&self) -> Value {
        json!({ "curves": self.curves })
    }
}
