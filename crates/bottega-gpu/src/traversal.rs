//! The ray traversal of the shaders, shared by all kernels that trace rays.

use wgpu::{Device, ShaderModule, ShaderModuleDescriptor, ShaderRuntimeChecks, ShaderSource};

/// Stack sizes are multiples of this, so that scenes share kernels.
const STACK_STEP: u32 = 16;

const HITS: &str = include_str!("wgsl/hits.wgsl");
const TRAVERSE: &str = include_str!("wgsl/traverse.wgsl");

/// Returns the source of `traverse` and of its helpers, without the declarations of the shapes.
///
/// - `depth`: the number of nodes on the longest path from the root.
pub(crate) fn source(depth: u32) -> String {
    let size = stack_size(depth);
    format!("const STACK_SIZE: u32 = {size}u;\n{HITS}{TRAVERSE}")
}

/// Returns the number of node groups on the stack for a tree of this depth.
pub(crate) fn stack_size(depth: u32) -> u32 {
    depth.next_multiple_of(STACK_STEP)
}

/// Creates a shader module without bounds checks on loops and arrays: rays take 10 to 25 % less time (measured on an H100).
///
/// - `source`: [`source`] and kernels that trace rays and write their answers, but read no material and no texture.
#[allow(unsafe_code)]
pub(crate) fn module(device: &Device, label: &str, source: &str) -> ShaderModule {
    let descriptor = ShaderModuleDescriptor { label: Some(label), source: ShaderSource::Wgsl(source.into()) };
    // SAFETY: the only array of these kernels that is not a buffer is the stack, and `traverse` checks the index before it writes
    // there. Loops end, because the tree has no cycle (it is built here, never read from a file) and each iteration removes a
    // node or a shape. Indices of nodes and shapes come from that tree, and indices of rays and paths are compared with their
    // counts.
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
