//! Reader from XML to objects: includes, parameters, properties, references.

use std::cell::Cell;
use std::collections::BTreeMap;

use super::document::{Child, Class, Document, Object, ObjectId, ObjectProperty};
use super::placement::Transform;
use super::report::ImportReport;
use super::transform;
use super::value::{self, Value};
use super::xml::{self, XmlElement};
use crate::import::text_place::{ImportResult, TextFault, TextPlace};
use crate::keys::KEYS_MAX;
use crate::options::LoadOptions;
use crate::resource::{Location, Resources};
use crate::text::{decode_xml, shortened};

/// Maximal number of included files.
const INCLUDES_MAX: usize = 1000;

/// Maximal depth of includes.
const INCLUDE_DEPTH_MAX: usize = 16;

/// Maximal length of an attribute after parameter substitution, in bytes.
const EXPANDED_MAX: usize = 1 << 16;

/// Maximal depth of nested objects, including by references.
const DEPTH_MAX: usize = 64;

impl Document {
    /// Reads a scene with all included files.
    pub(super) fn read(
        text: &[u8],
        options: &LoadOptions,
        resources: &Resources<'_>,
        report: &mut ImportReport,
    ) -> ImportResult<Self> {
        let mut reader = DocumentReader {
            resources,
            report,
            defines: options.defines.iter().map(|(name, value)| (name.clone(), (value.clone(), false))).collect(),
            objects: Vec::new(),
            ids: BTreeMap::new(),
            aliases: Vec::new(),
            references: Vec::new(),
            search_folders: Vec::new(),
            included: Vec::new(),
            include_count: 0,
            depth: 0,
            is_old: false,
        };
        let root = reader.parse(text, 0)?;
        if root.name != "scene" {
            return Err(root.at.fault(format!("the outermost element is <{}>, not <scene>", root.name)).into());
        }
        let version = root.attribute("version").unwrap_or_default().trim();
        reader.is_old = version.starts_with("0.") || version.starts_with("1.");
        let mut scene = Container::default();
        reader.contents(root.children, &mut scene, true)?;
        reader.resolve(&mut scene)?;
        for (name, (_, used)) in &reader.defines {
            if !used && options.defines.iter().any(|(define, _)| define == name) {
                reader
                    .report
                    .warn(TextPlace::default(), format!("no parameter of the scene is called `{}`", shortened(name)));
            }
        }
        let roots = scene.children.iter().map(|child| child.object).collect();
        for property in &scene.properties {
            reader
                .report
                .warn(property.at, format!("`{}` of the scene itself has no meaning", shortened(&property.name)));
        }
        let DocumentReader { objects, search_folders, is_old, .. } = reader;
        check_cycles(&objects)?;
        Ok(Self { objects, roots, is_old, search_folders })
    }
}

/// The properties and nested objects of an element.
#[derive(Default)]
struct Container {
    properties: Vec<ObjectProperty>,
    children: Vec<Child>,
    /// Positions in `children` that are unresolved, with their indices in [`DocumentReader::references`].
    pending: Vec<(usize, usize)>,
}

struct DocumentReader<'a, 'b> {
    resources: &'a Resources<'b>,
    report: &'a mut ImportReport,
    /// Value of each parameter; `true`: it was used.
    defines: BTreeMap<String, (String, bool)>,
    objects: Vec<Object>,
    ids: BTreeMap<String, (ObjectId, TextPlace)>,
    /// New id, existing id and location.
    aliases: Vec<(String, String, TextPlace)>,
    /// Object, index of its child, and the id that it refers to, with location.
    references: Vec<(ObjectId, usize, String, TextPlace)>,
    search_folders: Vec<String>,
    /// Files being read, innermost last.
    included: Vec<Location>,
    include_count: usize,
    /// Current depth of nested objects.
    depth: usize,
    /// `true`: a Mitsuba 0.x file; see [`Document::is_old`].
    is_old: bool,
}

impl DocumentReader<'_, '_> {
    fn parse(&mut self, text: &[u8], file: u32) -> ImportResult<XmlElement> {
        let (budget, path) = (self.resources.budget(), self.report.files.path(file).to_path_buf());
        let text = decode_xml(&path, text, budget)?;
        let mut left_out = Vec::new();
        let book = |bytes| budget.take(&path, "", bytes);
        let parsed = xml::parse(&text, file, book, |at| left_out.push(at));
        for at in left_out {
            self.report.warn(at, "the text in CDATA between the elements is left out");
        }
        parsed
    }

    /// Reads the contents of an element.
    fn contents(&mut self, elements: Vec<XmlElement>, container: &mut Container, is_scene: bool) -> ImportResult<()> {
        for mut element in elements {
            match element.name.as_str() {
                "default" => {
                    let name = self.required(&element, "name")?;
                    let value = self.required(&element, "value")?;
                    self.defines.entry(name).or_insert((value, false));
                    continue;
                }
                "include" => {
                    self.include(&mut element, container, is_scene)?;
                    continue;
                }
                "path" => {
                    let folder = self.required(&element, "value")?;
                    self.search_folders.push(folder);
                    continue;
                }
                "alias" => {
                    let (id, alias) = (self.required(&element, "id")?, self.required(&element, "as")?);
                    self.aliases.push((alias, id, element.at));
                    continue;
                }
                _ => {}
            }
            self.expand(&mut element)?;
            let name = snake_case(element.attribute("name").unwrap_or_default());
            let at = element.at;
            let is_object = element.attribute("type").is_some();
            if element.name == "ref" {
                let id = element.attribute("id").ok_or_else(|| at.fault("<ref> has no `id`"))?.to_owned();
                container.pending.push((container.children.len(), self.references.len()));
                self.references.push((ObjectId(usize::MAX), 0, id, at));
                container.children.push(Child { name, object: ObjectId(usize::MAX), at, used: Cell::new(false) });
            } else if let Some(class) = Class::of_tag(&element.name)
                && (is_object || element.name != "spectrum")
            {
                let object = self.object(element, class)?;
                container.children.push(Child { name, object, at, used: Cell::new(false) });
            } else {
                self.property(&element, name, container)?;
            }
        }
        Ok(())
    }

    fn object(&mut self, element: XmlElement, class: Class) -> ImportResult<ObjectId> {
        let at = element.at;
        let Some(plugin) = element.attribute("type").map(str::to_owned) else {
            return Err(at.fault(format!("<{}> has no `type`", element.name)).into());
        };
        let id = element.attribute("id").unwrap_or_default().to_owned();
        self.report_attributes(&element, &["type"]);
        self.depth += 1;
        if self.depth > DEPTH_MAX {
            let problem = format!("objects are within one another more than {DEPTH_MAX} deep");
            return Err(at.fault(problem).into());
        }
        let mut container = Container::default();
        self.contents(element.children, &mut container, false)?;
        self.depth -= 1;
        let object = ObjectId(self.objects.len());
        for (child, reference) in container.pending {
            self.references[reference].0 = object;
            self.references[reference].1 = child;
        }
        if !id.is_empty()
            && let Some((_, first)) = self.ids.insert(id.clone(), (object, at))
        {
            let first = self.report.files.show(first);
            return Err(at.fault(format!("the id `{}` is already that of {first}", shortened(&id))).into());
        }
        let Container { properties, children, .. } = container;
        self.objects.push(Object { class, plugin, id, at, properties, children });
        Ok(object)
    }

    fn property(&mut self, element: &XmlElement, name: String, container: &mut Container) -> ImportResult<()> {
        let at = element.at;
        self.report_attributes(element, &[]);
        let value = match element.name.as_str() {
            "transform" => transform::read(element, self.is_old, self.report).map(|it| Value::Transform(Box::new(it))),
            "animation" => self.animation(element),
            _ => value::read(element).map_err(|error| at.fault(error)),
        };
        match value {
            Ok(Value::Unknown) => {
                self.report.warn(at, format!("<{}> is unknown and left out", shortened(&element.name)));
                return Ok(());
            }
            Ok(value) => {
                if container.properties.iter().any(|property| property.name == name) {
                    self.report.warn(at, format!("`{}` is there twice; the first one counts", shortened(&name)));
                    return Ok(());
                }
                container.properties.push(ObjectProperty { name, value, at, used: Cell::new(false) });
            }
            Err(fault) => return Err(fault.into()),
        }
        Ok(())
    }

    /// Reads the transformations of an `<animation>`, each with its time.
    fn animation(&mut self, element: &XmlElement) -> Result<Value, TextFault> {
        let mut keys: Vec<(f64, Transform)> = Vec::new();
        for child in &element.children {
            if child.name != "transform" {
                let message = format!("<{}> in an <animation> is left out", shortened(&child.name));
                self.report.warn(child.at, message);
                continue;
            }
            let time = child.required("time").and_then(value::number).map_err(|error| child.at.fault(error))?;
            if keys.last().is_some_and(|last| last.0 >= time) {
                return Err(child.at.fault("the times of an <animation> must ascend"));
            }
            if keys.len() >= KEYS_MAX {
                return Err(child.at.fault(format!("an <animation> has more than {KEYS_MAX} transformations")));
            }
            keys.push((time, transform::read(child, self.is_old, self.report)?));
        }
        Ok(match keys.as_slice() {
            [] => Value::Transform(Box::new(Transform::IDENTITY)),
            [only] => Value::Transform(Box::new(only.1)),
            _ => Value::Animation(keys),
        })
    }

    /// Reports unused attributes of an object, a property or the operations of a transformation.
    ///
    /// - `more`: allowed attributes beyond those of its tag.
    fn report_attributes(&mut self, element: &XmlElement, more: &[&str]) {
        let known: &[&str] = match element.name.as_str() {
            "translate" | "scale" | "point" | "vector" => &["x", "y", "z"],
            "rotate" => &["x", "y", "z", "angle"],
            "lookat" | "lookAt" => &["origin", "target", "up"],
            // The intent distinguishes kinds of spectra.
            "spectrum" | "color" => &["filename", "intent"],
            "blackbody" => &["temperature", "scale"],
            "transform" => &["time"],
            _ => &[],
        };
        for (name, _) in &element.attributes {
            if !matches!(name.as_str(), "name" | "value" | "id") && !known.iter().chain(more).any(|it| it == name) {
                let tag = shortened(&element.name);
                self.report.warn(element.at, format!("the attribute `{}` of <{tag}> is left out", shortened(name)));
            }
        }
        if matches!(element.name.as_str(), "transform" | "animation") {
            element.children.iter().for_each(|child| self.report_attributes(child, &[]));
        }
    }

    /// Inserts the contents of another file.
    fn include(&mut self, element: &mut XmlElement, container: &mut Container, is_scene: bool) -> ImportResult<()> {
        let reference = self.required(element, "filename")?;
        let at = element.at;
        if self.included.len() >= INCLUDE_DEPTH_MAX {
            return Err(at.fault(format!("files include one another more than {INCLUDE_DEPTH_MAX} deep")).into());
        }
        self.include_count += 1;
        if self.include_count > INCLUDES_MAX {
            return Err(at.fault(format!("more than {INCLUDES_MAX} files are included")).into());
        }
        let place = self.report.files.show(at);
        // Look beside the scene first, then beside the including file.
        let folders: Vec<&str> = std::iter::once("").chain(self.included.last().map(Location::folder)).collect();
        let location = self.resources.locate_in(&folders, &reference, &place)?;
        if self.resources.is_scene(&location) || self.included.contains(&location) {
            return Err(at.fault(format!("`{}` includes itself", shortened(&reference))).into());
        }
        let bytes = self.resources.read(&location)?;
        let file = self.report.files.add(location.name.clone(), location.path().to_path_buf());
        let root = self.parse(&bytes, file)?;
        drop(bytes);
        self.included.push(location);
        if root.name == "scene" {
            self.contents(root.children, container, is_scene)?;
        } else {
            self.contents(vec![root], container, is_scene)?;
        }
        self.included.pop();
        Ok(())
    }

    /// Returns a required attribute, with parameters substituted.
    fn required(&mut self, element: &XmlElement, name: &str) -> ImportResult<String> {
        let Some(text) = element.attribute(name) else {
            return Err(element.at.fault(format!("<{}> has no `{name}`", element.name)).into());
        };
        self.with_parameters(text, element.at)
    }

    /// Substitutes parameters in all attributes of an element and of the operations of a transformation.
    fn expand(&mut self, element: &mut XmlElement) -> ImportResult<()> {
        let at = element.at;
        for index in 0..element.attributes.len() {
            if element.attributes[index].1.contains('$') {
                let expanded = self.with_parameters(&element.attributes[index].1, at)?;
                element.attributes[index].1 = expanded;
            }
        }
        if matches!(element.name.as_str(), "transform" | "animation") {
            element.children.iter_mut().try_for_each(|child| self.expand(child))?;
        }
        Ok(())
    }

    /// Replaces each `$name` by the value of the parameter with the longest matching name.
    fn with_parameters(&mut self, text: &str, at: TextPlace) -> ImportResult<String> {
        if !text.contains('$') {
            return Ok(text.to_owned());
        }
        let mut expanded = String::new();
        let mut rest = text;
        while let Some(index) = rest.find('$') {
            expanded.push_str(&rest[..index]);
            rest = &rest[index + 1..];
            let fits = self.defines.iter_mut().filter(|(name, _)| rest.starts_with(name.as_str()) && !name.is_empty());
            let Some((name, (value, used))) = fits.max_by_key(|(name, _)| name.len()) else {
                let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                let name = shortened(&name).into_owned();
                let problem = format!("the parameter `${name}` has no value; give it one with `-D {name}=…`");
                return Err(at.fault(problem).into());
            };
            *used = true;
            expanded.push_str(value);
            rest = &rest[name.len()..];
            if expanded.len() > EXPANDED_MAX {
                return Err(at.fault(format!("parameters grow beyond {EXPANDED_MAX} bytes")).into());
            }
        }
        expanded.push_str(rest);
        self.resources.budget().take(self.report.files.path(at.file), &self.report.files.show(at), expanded.len())?;
        Ok(expanded)
    }

    /// Resolves references, also to later objects.
    fn resolve(&mut self, scene: &mut Container) -> ImportResult<()> {
        for (alias, id, at) in std::mem::take(&mut self.aliases) {
            let Some(&target) = self.ids.get(&id) else { return Err(Self::no_such_id(&id, at).into()) };
            if self.ids.insert(alias.clone(), target).is_some() {
                return Err(at.fault(format!("the id `{}` is used twice", shortened(&alias))).into());
            }
        }
        for (owner, child, id, at) in std::mem::take(&mut self.references) {
            let Some(&(target, _)) = self.ids.get(&id) else { return Err(Self::no_such_id(&id, at).into()) };
            if let Some(owner) = self.objects.get_mut(owner.0) {
                owner.children[child].object = target;
            } else if let Some(child) = scene.children.iter_mut().find(|child| child.at == at) {
                child.object = target;
            }
        }
        Ok(())
    }

    fn no_such_id(id: &str, at: TextPlace) -> TextFault {
        at.fault(format!("nothing has the id `{}`", shortened(id)))
    }
}

/// Checks that no object contains itself by references, and that nesting is limited.
fn check_cycles(objects: &[Object]) -> ImportResult<()> {
    #[derive(Clone, Copy, PartialEq)]
    enum ReadState {
        New,
        Open,
        Done,
    }
    let mut states = vec![ReadState::New; objects.len()];
    // Number of levels below each finished object.
    let mut depths = vec![0; objects.len()];
    for start in 0..objects.len() {
        if states[start] != ReadState::New {
            continue;
        }
        states[start] = ReadState::Open;
        // Object and its next child. Not recursive, as references may chain through the whole file.
        let mut path = vec![(start, 0)];
        while let Some((object, next)) = path.last_mut() {
            let object = *object;
            let Some(child) = objects[object].children.get(*next) else {
                let below = objects[object].children.iter().map(|child| depths[child.object.0] + 1).max();
                depths[object] = below.unwrap_or(0);
                if depths[object] > DEPTH_MAX {
                    let problem = format!("objects are within one another more than {DEPTH_MAX} deep");
                    return Err(objects[object].at.fault(problem).into());
                }
                states[object] = ReadState::Done;
                path.pop();
                continue;
            };
            *next += 1;
            let target = child.object.0;
            match states[target] {
                ReadState::Done => {}
                ReadState::Open => return Err(child.at.fault("an object contains itself by this reference").into()),
                ReadState::New => {
                    states[target] = ReadState::Open;
                    path.push((target, 0));
                }
            }
        }
    }
    Ok(())
}

/// Converts camel-case names of Mitsuba 0.x (`maxDepth`, `intIOR`) to snake case.
fn snake_case(name: &str) -> String {
    let mut snake = String::with_capacity(name.len() + 4);
    let mut was_lower = false;
    for c in name.chars() {
        if c.is_ascii_uppercase() && was_lower {
            snake.push('_');
        }
        was_lower = c.is_ascii_lowercase() || c.is_ascii_digit();
        snake.push(c.to_ascii_lowercase());
    }
    snake
}

#[cfg(test)]
mod tests {
    use super::snake_case;

    #[test]
    fn names_of_the_old_line_become_those_of_the_new_one() {
        let pairs = [
            ("maxDepth", "max_depth"),
            ("intIOR", "int_ior"),
            ("alphaU", "alpha_u"),
            ("toWorld", "to_world"),
            ("sigmaT", "sigma_t"),
            ("diffuseReflectance", "diffuse_reflectance"),
            ("to_world", "to_world"),
            ("color0", "color0"),
            ("p0", "p0"),
        ];
        for (old, new) in pairs {
            assert_eq!(snake_case(old), new);
        }
    }
}
