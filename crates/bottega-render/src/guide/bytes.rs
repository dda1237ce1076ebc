//! The byte form of a guide, for other machines that render the same view of the same scene.
//!
//! Four-byte numbers, little-endian: the lattice (low corner, cells per unit of length, cells along each axis: three
//! each); the numbers of nodes, regions and agents; columns and rows of the picture's parts, and the number of parts
//! that are known; columns and rows of the plan's zones, and the way of each zone; plane and link of each node; share
//! of each region; data of each agent; importance of each part. Then, for each region, the cumulative weights of its
//! cells, two bytes each.

use super::agent::{NUMBERS, PictureWorth, RegionAgent};
use super::directions::{CELLS, Directions};
use super::plan::{PaintPlan, PaintingWay};
use super::tree::{Guide, GuideNode, Lattice, Region};

/// The error of bytes that are not valid data of a prepass: a guide, or photon maps and agents.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the bytes are not a guide of a scene")]
pub struct UnreadGuide;

impl Guide {
    /// Returns the guide as bytes.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let (lattice, nodes, regions, agents) = self.parts();
        let (columns, rows, worth) = self.expected().parts();
        let mut bytes = Vec::new();
        let mut put = |number: u32| bytes.extend(number.to_le_bytes());
        lattice.to_numbers().into_iter().for_each(&mut put);
        put(nodes.len() as u32);
        put(regions.len() as u32);
        put(agents.len() as u32);
        [columns, rows, worth.len() as u32].into_iter().for_each(&mut put);
        let (columns, rows, ways) = self.plan().parts();
        [columns, rows].into_iter().for_each(&mut put);
        ways.iter().for_each(|way| put(way.number() as u32));
        nodes.iter().flat_map(|node| node.to_numbers()).for_each(&mut put);
        regions.iter().for_each(|region| put(region.share.to_bits()));
        agents.iter().flat_map(|agent| agent.to_numbers()).for_each(&mut put);
        worth.iter().for_each(|worth| put(worth.to_bits()));
        regions
            .iter()
            .flat_map(|region| region.directions.cumulative())
            .for_each(|weight| bytes.extend(weight.to_le_bytes()));
        bytes
    }

    /// Reads a guide from untrusted bytes.
    ///
    /// # Errors
    /// The bytes are not a valid guide.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<Self, UnreadGuide> {
        read(bytes).ok_or(UnreadGuide)
    }
}

/// Reads a guide; `None`: not valid.
fn read(bytes: &[u8]) -> Option<Guide> {
    let mut rest = bytes;
    let mut number = || {
        let (first, others) = rest.split_first_chunk::<4>()?;
        rest = others;
        Some(u32::from_le_bytes(*first))
    };
    let mut lattice = [0; 9];
    for it in &mut lattice {
        *it = number()?;
    }
    let lattice = Lattice::from_numbers(lattice)?;
    let (nodes, regions, agents) = (number()? as usize, number()? as usize, number()? as usize);
    let (columns, rows, parts) = (number()?, number()?, number()? as usize);
    let zones = [number()?, number()?];
    let zone_count = zones[0].checked_mul(zones[1])? as usize;
    // Check the sizes before allocating
    let sizes = [(nodes, 8), (regions, 4 + 2 * (CELLS + 1)), (agents, 4 * NUMBERS), (parts, 4), (zone_count, 4)];
    let all = sizes.iter().try_fold(4 * 17_usize, |all, &(count, size)| all.checked_add(count.checked_mul(size)?))?;
    if all != bytes.len() {
        return None;
    }
    let ways =
        (0..zone_count).map(|_| PaintingWay::ALL.get(number()? as usize).copied()).collect::<Option<Vec<_>>>()?;
    let plan = PaintPlan::new(zones[0], zones[1], ways)?;
    let nodes =
        (0..nodes).map(|_| Some(GuideNode::from_numbers([number()?, number()?]))).collect::<Option<Vec<_>>>()?;
    let shares = (0..regions).map(|_| number().map(f32::from_bits)).collect::<Option<Vec<_>>>()?;
    let agent = |_| {
        let mut numbers = [0; NUMBERS];
        for it in &mut numbers {
            *it = number()?;
        }
        RegionAgent::from_numbers(&numbers)
    };
    let agents = (0..agents).map(agent).collect::<Option<Vec<_>>>()?;
    let worth = (0..parts).map(|_| number().map(f32::from_bits)).collect::<Option<Vec<_>>>()?;
    let weights = rest.chunks_exact(2 * (CELLS + 1));
    let region = |(share, weights): (f32, &[u8])| {
        let mut of_cells = weights.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]]));
        let directions = Directions::from_cumulative(std::array::from_fn(|_| of_cells.next().unwrap_or_default()))?;
        (0.0..=1.0).contains(&share).then_some(Region { share, directions })
    };
    let regions = shares.into_iter().zip(weights).map(region).collect::<Option<Vec<_>>>()?;
    let expected = PictureWorth::from_parts(columns, rows, worth)?;
    Some(Guide::from_parts(lattice, nodes, regions, agents, expected)?.planned(plan))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use proptest::prelude::*;

    use super::super::learn::tests::example;
    use super::*;

    #[test]
    fn a_guide_is_read_back_bit_for_bit() {
        let plan = PaintPlan::new(2, 1, vec![PaintingWay::Plain, PaintingWay::ByWorth]).unwrap();
        let guide = example(Vec3::new(0.48, 0.8, 0.36)).planned(plan);
        let bytes = guide.to_bytes();
        let back = Guide::from_bytes(&bytes).unwrap();
        assert_eq!(back.to_bytes(), bytes);
        assert_eq!((back.memory_bytes(), back.plan()), (guide.memory_bytes(), guide.plan()));
        for x in -8..8 {
            let p = Vec3::new(x as f32 / 8.0, 0.0, 0.3);
            let [one, other] = [&guide, &back].map(|it| {
                it.at(p, Vec3::Y).map(|region| (region.share().to_bits(), region.sample([0.3, 0.7]).1.to_bits()))
            });
            assert_eq!(one, other);
        }
        let nothing = Guide::default();
        assert!(Guide::from_bytes(&nothing.to_bytes()).unwrap().at(Vec3::ZERO, Vec3::Y).is_none());
    }

    proptest! {
        #[test]
        fn damaged_bytes_of_a_guide_never_panic_or_loop(at in any::<prop::sample::Index>(), byte in any::<u8>(), end in any::<prop::sample::Index>()) {
            let mut bytes = example(Vec3::Y).to_bytes();
            // Most bytes are weights; errors are likely only in the leading ones.
            let place = at.index(bytes.len().min(400));
            bytes[place] = byte;
            if let Ok(guide) = Guide::from_bytes(&bytes) {
                for i in 0..64 {
                    let p = Vec3::new(i as f32 / 32.0 - 1.0, 0.0, 0.3);
                    if let Some(region) = guide.at(p, Vec3::Y) {
                        let (w, pdf) = region.sample([i as f32 / 64.0, 0.5]);
                        prop_assert!(w.is_normalized() && pdf > 0.0);
                    }
                }
            }
            prop_assert!(Guide::from_bytes(&bytes[..end.index(bytes.len())]).is_err());
        }
    }
}
