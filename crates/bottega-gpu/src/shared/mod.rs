//! Constants, codes, flags and record layouts that this crate shares with its shaders.
//!
//! Each is declared once, in Rust: a line of [`constants!`](declare::constants) is a constant of both languages, a struct of
//! [`buffer_struct!`](declare::buffer_struct) is a struct of both, and the places of the fields of a
//! [`record!`](bottega_render::record) are constants of the shaders. [`source`] comes first in every shader; no shader repeats
//! any of it by hand (see `check.rs`).

mod declare;
pub(crate) mod geometry;
pub(crate) mod materials;
pub(crate) mod paths;
mod scattering;
mod scene;

#[cfg(test)]
mod check;
#[cfg(test)]
mod twins;

use std::sync::LazyLock;

use declare::{Constant, Layout};

/// Returns the common start of all shaders.
pub(crate) fn source() -> &'static str {
    static SOURCE: LazyLock<String> = LazyLock::new(|| {
        let constants = constants().into_iter().map(|constant| constant.wgsl());
        let layouts = layouts().flat_map(Layout::constants).map(|constant| constant.wgsl());
        constants.chain(layouts).chain(structs()).collect()
    });
    &SOURCE
}

fn constants() -> Vec<Constant> {
    let tables = [
        geometry::CONSTANTS,
        materials::SURFACES,
        materials::TEXTURES,
        paths::CONSTANTS,
        scattering::CONSTANTS,
        scattering::LAYERS,
        scene::CODES,
        scene::CONSTANTS,
    ];
    tables.into_iter().flatten().cloned().chain(scattering::film_gaussians()).collect()
}

fn layouts() -> impl Iterator<Item = &'static Layout> {
    [geometry::LAYOUTS, materials::LAYOUTS, paths::LAYOUTS, scene::LAYOUTS].into_iter().flatten()
}

fn structs() -> impl Iterator<Item = String> {
    let whole = [geometry::Shape::DECLARED, geometry::Ray::DECLARED, geometry::RayParams::DECLARED];
    whole.into_iter().chain([paths::BatchParams::DECLARED]).map(|it| it.wgsl()).chain([geometry::node_source()])
}

#[cfg(test)]
mod tests {
    use super::declare::{DeclaredType, Value};
    use super::*;
    use wgpu::naga;

    fn parsed() -> naga::Module {
        let source = source();
        naga::front::wgsl::parse_str(source).unwrap_or_else(|error| panic!("{}", error.emit_to_string(source)))
    }

    /// The bits of the numbers of a constant in a module.
    fn bits(module: &naga::Module, of: naga::Handle<naga::Expression>) -> Vec<u32> {
        match &module.global_expressions[of] {
            naga::Expression::Literal(naga::Literal::U32(number)) => vec![*number],
            naga::Expression::Literal(naga::Literal::F32(number)) => vec![number.to_bits()],
            naga::Expression::Compose { components, .. } => {
                components.iter().flat_map(|&part| bits(module, part)).collect()
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_shader_reads_the_very_bits_of_each_constant() {
        let module = parsed();
        let all: Vec<_> = constants().into_iter().chain(layouts().flat_map(Layout::constants)).collect();
        assert_eq!(module.constants.len(), all.len(), "a name stands for two things");
        for constant in all {
            let found = module.constants.iter().find(|(_, it)| it.name.as_deref() == Some(&constant.name));
            let (_, found) = found.unwrap_or_else(|| panic!("{} is missing", constant.name));
            let expected = match constant.value {
                Value::U32(number) => vec![number],
                Value::F32(number) => vec![number.to_bits()],
                Value::Floats(ref numbers) => numbers.iter().map(|number| number.to_bits()).collect(),
                Value::Words(ref numbers) => numbers.to_vec(),
            };
            assert_eq!(bits(&module, found.init), expected, "{}", constant.name);
        }
    }

    #[test]
    fn a_shader_finds_the_fields_of_structs_where_rust_has_them() {
        let module = parsed();
        let check = |declared: DeclaredType| {
            let mut types = module.types.iter().map(|(_, it)| it);
            let found = types.find(|it| it.name.as_deref() == Some(declared.name)).expect(declared.name);
            let naga::TypeInner::Struct { members, span } = &found.inner else {
                panic!("{} is not a struct", declared.name)
            };
            assert_eq!(*span as usize, declared.size, "{}", declared.name);
            for (member, field) in members.iter().zip(declared.fields) {
                let place = (member.name.as_deref(), member.offset as usize);
                assert_eq!(place, (Some(field.name), field.offset), "{}", declared.name);
            }
            assert_eq!(members.len(), declared.fields.len(), "{}", declared.name);
        };
        check(geometry::Shape::DECLARED);
        check(geometry::Ray::DECLARED);
        check(geometry::RayParams::DECLARED);
        check(paths::BatchParams::DECLARED);
    }
}
