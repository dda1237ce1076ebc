//! Experiments.
mod peer;
use std::sync::Arc;
use bottega_image::{Layout, Rect, Tile, read_picture};
use bottega_render::{BlockWork, Filter, PathSettings, PrepareOptions, PreparedScene, View};
fn cpu() -> f64 { let s = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap(); s.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9 }
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let dir = &a[1]; let spp: u32 = a[2].parse().unwrap(); let reps: u64 = a[3].parse().unwrap();
    let roulette: u32 = std::env::var("ROULETTE").map_or(3, |v| v.parse().unwrap());
    let guiding = std::env::var("GUIDING").map_or(true, |v| v != "0");
    let noise = [0.00028, 0.0027, 0.0016, 0.015];
    for scene in &a[4..] {
        let i = (scene.as_bytes()[0] - b'a') as usize;
        let s = peer::load(format!("{dir}/{scene}.json").as_ref()).unwrap();
        let reference = read_picture(format!("{dir}/reference/ref_{scene}.exr")).unwrap();
        for rep in 0..reps {
            let prepared = Arc::new(PreparedScene::new(Arc::new(s.clone()), &PrepareOptions::default()).unwrap());
            let view = View { camera: 0, width: 512, height: 512 };
            let settings = Arc::new(PathSettings { seed: rep, max_depth: if i == 3 { 25 } else { 17 }, filter: Filter::Box, roulette_depth: roulette, guiding, ..PathSettings::default() });
            let rect = Rect::of_size(512, 512);
            let layout = Layout::new(bottega_image::AovSet::NONE);
            let (mut errors, mut sums, mut refs) = (vec![], 0.0f64, 0.0f64);
            let t0 = cpu();
            let mut tl = 0.0;
            for block in rect.blocks(16) {
                let tile = Tile::new(block, layout);
                let out = BlockWork { scene: prepared.clone(), view, settings: settings.clone(), tile, samples: 0..spp }.perform().unwrap();
                if tl == 0.0 { tl = cpu() - t0; }
                for (x, y) in block.pixels() {
                    let r = reference.data[(y * 512 + x) as usize];
                    let v: Vec<f32> = out.tile.pixel(x, y)[..3].iter().map(|s| s / spp as f32).collect();
                    let e: f64 = (0..3).map(|c| f64::from((v[c] - r[c]).powi(2) / (r[c] * r[c] + 1e-2)) / 3.0).sum();
                    errors.push(e);
                    sums += f64::from(v[0]+v[1]+v[2]); refs += f64::from(r[0]+r[1]+r[2]);
                }
            }
            let t = cpu() - t0;
            errors.sort_by(f64::total_cmp);
            let full = errors.iter().sum::<f64>() / errors.len() as f64;
            errors.truncate(errors.len() - errors.len() / 1000);
            let e = errors.iter().sum::<f64>() / errors.len() as f64 - noise[i];
            println!("{scene} spp {spp} cpu {t:.2} s (first {tl:.2}) {:.3} Mp/s relMSE {e:.5} untrimmed {full:.4} mean {:.4} eff {:.3}", 0.262144 * f64::from(spp) / t, sums / refs, 1.0 / (e * t));
        }
    }
}
