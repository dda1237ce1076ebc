//! The choice of an OpenEXR file's color channels.

use exr::meta::header::Header;

/// The color channels of one part of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Color {
    /// Index of the part within the file.
    pub(super) part: usize,
    /// Channels of red, green and blue, or of X, Y and Z; the same one three times for gray.
    pub(super) channels: [usize; 3],
    /// Index of the alpha channel; `None`: the part has none.
    pub(super) alpha: Option<usize>,
    /// `true`: the channels are X, Y and Z.
    pub(super) is_xyz: bool,
    /// A note for the user if there was a choice.
    pub(super) note: Option<String>,
}

/// The likelihood, by its name, that a layer is the picture itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Likeness {
    /// A layer without a name.
    Plain,
    /// A usual name of the whole picture.
    Beauty,
    Other,
    /// A name of an AOV.
    Aov,
}

impl Likeness {
    /// Classifies a layer.
    ///
    /// - `name`: full name of the layer, such as `ViewLayer.Combined`.
    fn of(name: &str) -> Self {
        const BEAUTY: [&str; 6] = ["combined", "rgba", "rgb", "color", "beauty", "image"];
        const AOVS: [&str; 8] = ["albedo", "normal", "position", "uv", "depth", "crypto", "motion", "mist"];
        let name = name.to_ascii_lowercase();
        let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
        match name.as_str() {
            "" => Self::Plain,
            _ if has(&AOVS) => Self::Aov,
            _ if has(&BEAUTY) => Self::Beauty,
            _ => Self::Other,
        }
    }
}

/// The interpretation of a layer's channels, the best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum ColorKind {
    Rgb,
    Xyz,
    Luminance,
}

/// Channels of one part with the same prefix, up to their last dot.
struct ChannelGroup<'a> {
    part: usize,
    /// Prefix with its dot; may be empty.
    prefix: &'a str,
    /// Index and last part of the name of each channel.
    channels: Vec<(usize, &'a str)>,
}

impl ChannelGroup<'_> {
    fn find(&self, name: &str) -> Option<usize> {
        self.channels.iter().find(|(_, last)| last.eq_ignore_ascii_case(name)).map(|&(index, _)| index)
    }

    fn triple(&self, names: [&str; 3]) -> Option<[usize; 3]> {
        let [a, b, c] = names.map(|name| self.find(name));
        Some([a?, b?, c?])
    }

    /// Returns the color channels, if any.
    fn color(&self, likeness: Likeness) -> Option<(ColorKind, [usize; 3])> {
        let rgb = self.triple(["R", "G", "B"]).or_else(|| self.triple(["red", "green", "blue"]));
        if let Some(channels) = rgb {
            return Some((ColorKind::Rgb, channels));
        }
        // In other layers they are positions, normals or motion.
        let xyz = self.triple(["X", "Y", "Z"]).filter(|_| likeness <= Likeness::Beauty);
        if let Some(channels) = xyz {
            return Some((ColorKind::Xyz, channels));
        }
        self.find("Y").map(|channel| (ColorKind::Luminance, [channel; 3]))
    }
}

/// Finds the color channels; `None`: there are none. In order of preference: R, G, B without a layer; in a layer with a
/// usual name of the whole picture; in any other layer that is not an AOV; X, Y, Z and then Y of those; the same of
/// AOVs; the only channel of the file. Parts are taken in file order. Names are compared without case.
pub(super) fn find_color(headers: &[Header]) -> Option<Color> {
    let names: Vec<Vec<String>> = headers
        .iter()
        .map(|header| header.channels.list.iter().map(|channel| channel.name.to_string()).collect())
        .collect();
    let part_name =
        |part: usize| headers[part].own_attributes.layer_name.as_ref().map(ToString::to_string).unwrap_or_default();
    let layers: Vec<ChannelGroup<'_>> =
        (0..headers.len()).filter(|&part| !headers[part].deep).flat_map(|part| layers(part, &names[part])).collect();
    // In a file with a single part, ignore the part's name.
    let label = |layer: &ChannelGroup<'_>| {
        let inner = layer.prefix.trim_matches('.');
        let outer = if headers.len() > 1 { part_name(layer.part) } else { String::new() };
        if outer.is_empty() || inner.is_empty() { outer + inner } else { format!("{outer}.{inner}") }
    };
    let ranked = layers.iter().filter_map(|layer| {
        let likeness = Likeness::of(&label(layer));
        let (kind, channels) = layer.color(likeness)?;
        Some(((likeness == Likeness::Aov, kind, likeness), layer, channels))
    });
    let candidates: Vec<_> = ranked.collect();
    // Of equals, take the first.
    let best = candidates.iter().min_by_key(|(rank, ..)| *rank);
    if let Some(&((_, kind, likeness), layer, channels)) = best {
        let others: Vec<String> = candidates.iter().map(|(_, other, _)| label(other)).collect();
        let name = label(layer);
        let note = match (likeness, others.len()) {
            (Likeness::Plain, _) => None,
            (_, 1) => Some(format!("its color is taken from its layer `{name}`")),
            _ => Some(format!("of its layers {} the color is taken from `{name}`", list(&others))),
        };
        let alpha = layer.find("A").or_else(|| layer.find("alpha"));
        return Some(Color { part: layer.part, channels, alpha, is_xyz: kind == ColorKind::Xyz, note });
    }
    single(&layers, &names)
}

/// Returns the only channel of a file that is not alpha, as gray.
fn single(layers: &[ChannelGroup<'_>], names: &[Vec<String>]) -> Option<Color> {
    let is_alpha = |name: &str| name.eq_ignore_ascii_case("A") || name.eq_ignore_ascii_case("alpha");
    let channels = layers.iter().flat_map(|layer| layer.channels.iter().map(move |channel| (layer, channel)));
    let mut values = channels.filter(|(_, (_, last))| !is_alpha(last));
    let (layer, &(channel, _)) = values.next()?;
    if values.next().is_some() {
        return None;
    }
    let name = &names[layer.part][channel];
    Some(Color {
        part: layer.part,
        channels: [channel; 3],
        alpha: layer.find("A").or_else(|| layer.find("alpha")),
        is_xyz: false,
        note: Some(format!("its only channel, `{name}`, is taken as gray")),
    })
}

/// Returns the layers of a part, in the order of its channels.
fn layers(part: usize, names: &[String]) -> Vec<ChannelGroup<'_>> {
    let mut layers: Vec<ChannelGroup<'_>> = Vec::new();
    for (index, name) in names.iter().enumerate() {
        let (prefix, last) = name.split_at(name.rfind('.').map_or(0, |dot| dot + 1));
        match layers.iter_mut().find(|layer| layer.prefix == prefix) {
            Some(layer) => layer.channels.push((index, last)),
            None => layers.push(ChannelGroup { part, prefix, channels: vec![(index, last)] }),
        }
    }
    layers
}

/// Lists the first few names, for a message.
fn list(names: &[String]) -> String {
    let shown: Vec<String> = names.iter().take(5).map(|name| format!("`{name}`")).collect();
    let rest = names.len().saturating_sub(shown.len());
    if rest > 0 { format!("{} and {rest} more", shown.join(", ")) } else { shown.join(", ") }
}

#[cfg(test)]
mod tests {
    use exr::{
        meta::header::Header,
        prelude::{ChannelDescription, SampleType, SmallVec, Text},
    };

    use super::*;

    /// Name of a part, and the names of its channels.
    type ColorPart<'a> = (&'a str, &'a [&'a str]);

    fn headers(parts: &[ColorPart<'_>]) -> Vec<Header> {
        let header = |(name, channels): &ColorPart<'_>| {
            let list: SmallVec<[ChannelDescription; 5]> =
                channels.iter().map(|name| ChannelDescription::named(*name, SampleType::F32)).collect();
            Header::new(Text::from(*name), (2_usize, 2_usize), list)
        };
        parts.iter().map(header).collect()
    }

    /// Returns the part, and the names of the channels that are chosen.
    fn taken(parts: &[ColorPart<'_>]) -> Option<(usize, String, Option<String>)> {
        let headers = headers(parts);
        let color = find_color(&headers)?;
        let list = &headers[color.part].channels.list;
        let names = color.channels.into_iter().chain(color.alpha).map(|index| list[index].name.to_string());
        Some((color.part, names.collect::<Vec<_>>().join(" "), color.note))
    }

    #[test]
    fn the_picture_itself_is_found_among_layers() {
        let cases: [(&[ColorPart<'_>], usize, &str, bool); 14] = [
            (&[("", &["A", "B", "G", "R"])], 0, "R G B A", false),
            (&[("", &[".B", ".G", ".R"])], 0, ".R .G .B", false),
            (&[("", &["b", "g", "r"])], 0, "r g b", false),
            (&[("", &["Beauty.B", "Beauty.G", "Beauty.R"])], 0, "Beauty.R Beauty.G Beauty.B", true),
            (
                &[(
                    "",
                    &[
                        "V.Albedo.B",
                        "V.Albedo.G",
                        "V.Albedo.R",
                        "V.Combined.A",
                        "V.Combined.B",
                        "V.Combined.G",
                        "V.Combined.R",
                    ],
                )],
                0,
                "V.Combined.R V.Combined.G V.Combined.B V.Combined.A",
                true,
            ),
            (&[("", &["B", "G", "R", "beauty.B", "beauty.G", "beauty.R"])], 0, "R G B", false),
            (&[("", &["Y"])], 0, "Y Y Y", false),
            (&[("", &["X", "Y", "Z"])], 0, "X Y Z", false),
            (&[("", &["Y", "albedo.B", "albedo.G", "albedo.R"])], 0, "Y Y Y", false),
            (&[("", &["R"])], 0, "R R R", true),
            (&[("", &["A", "depth.Z"])], 0, "depth.Z depth.Z depth.Z", true),
            (&[("albedo", &["B", "G", "R"]), ("beauty", &["B", "G", "R"])], 1, "R G B", true),
            (&[("N", &["X", "Y", "Z"]), ("left", &["B", "G", "R"])], 1, "R G B", true),
            (&[("", &["a.B", "a.G", "a.R", "b.B", "b.G", "b.R"])], 0, "a.R a.G a.B", true),
        ];
        for (parts, part, names, has_note) in cases {
            let (found, found_names, note) = taken(parts).unwrap_or_else(|| panic!("{parts:?}"));
            assert_eq!((found, found_names.as_str(), note.is_some()), (part, names, has_note), "{parts:?}: {note:?}");
        }
        for parts in [&[("", &["Z", "id"][..])][..], &[("", &["A"])], &[("", &["normal.X", "normal.Z"])]] {
            assert_eq!(taken(parts), None, "{parts:?}");
        }
    }
}
