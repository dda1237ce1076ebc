//! The part of the shaders that follows rays, which all kernels share that do.

use wgpu::{Device, ShaderModule, ShaderModuleDescriptor, ShaderRuntimeChecks, ShaderSource};

/// Stacks come in multiples of so many, so that scenes share kernels.
const STACK_STEP: u32 = 16;

const HITS: &str = include_str!("wgsl/hits.wgsl");
const TRAVERSE: &str = include_str!("wgsl/traverse.wgsl");

/// The source of `traverse`, and of what it needs beside the shapes.
///
/// - `depth`: nodes on the longest way down the tree.
pub(crate) fn source(depth: u32) -> String {
    let size = stack_size(depth);
    format!("const STACK_SIZE: u32 = {size}u;\n{HITS}{TRAVERSE}")
}

/// Groups of nodes that fit on the stack of a tree of this depth.
pub(crate) fn stack_size(depth: u32) -> u32 {
    depth.next_multiple_of(STACK_STEP)
}

/// A module whose loops and arrays the compiler does not guard again: rays take 10 to 25 % less time (measured on an H100).
///
/// - `source`: [`source`] and kernels that follow rays and write their answers, but read no material and no texture.
#[allow(unsafe_code)]
pub(crate) fn module(device: &Device, label: &str, source: &str) -> ShaderModule {
    let descriptor = ShaderModuleDescriptor { label: Some(label), source: ShaderSource::Wgsl(source.into()) };
    // SAFETY: the one array of these kernels that is not a buffer is the stack, and `traverse` asks before it writes there; loops
    // end, because the tree has no cycle (built here, never read from a file) and each turn takes a node or a shape off. Numbers
    // of nodes and shapes are those of that tree, and numbers of rays and paths are compared with how many there are.
    unsafe { device.create_shader_module_trusted(descriptor, ShaderRuntimeChecks::unchecked()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_group_of_nodes_on_the_way_down_fits_on_the_stack() {
        for depth in 1..100 {
            assert!(stack_size(depth) >= depth && stack_size(depth) < depth + STACK_STEP);
            assert!(source(depth).contains(&format!("STACK_SIZE: u32 = {}u", stack_size(depth))));
        }
    }
}
