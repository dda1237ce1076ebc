//! Directives that change the current transformation.

use glam::{DAffine3, DVec3};

use super::params::number;
use super::parser::{Parser, ended, text};
use super::token::{Token, Tokens};
use super::transform::{from_columns, look_at};
use crate::import::text_place::{ImportResult, TextFault, TextPlace};
use crate::text::shortened;

impl Parser<'_, '_> {
    /// Changes or stores the current transformation.
    pub(super) fn transformation(&mut self, word: &str, at: TextPlace, tokens: &mut Tokens<'_>) -> ImportResult<()> {
        match word {
            "Identity" => self.state.transform(|_| DAffine3::IDENTITY),
            "Translate" => {
                let offset = DVec3::from_array(numbers(tokens, at, word)?);
                self.state.transform(|ctm| *ctm * DAffine3::from_translation(offset));
            }
            "Scale" => {
                let scale = DVec3::from_array(numbers(tokens, at, word)?);
                self.state.transform(|ctm| *ctm * DAffine3::from_scale(scale));
            }
            "Rotate" => {
                let [degrees, x, y, z] = numbers(tokens, at, word)?;
                let axis = DVec3::new(x, y, z).try_normalize().ok_or_else(|| at.fault("the axis has no direction"))?;
                let rotation = DAffine3::from_axis_angle(axis, degrees.to_radians());
                self.state.transform(|ctm| *ctm * rotation);
            }
            "LookAt" => {
                let [ex, ey, ez, lx, ly, lz, ux, uy, uz] = numbers(tokens, at, word)?;
                let (eye, look, up) = (DVec3::new(ex, ey, ez), DVec3::new(lx, ly, lz), DVec3::new(ux, uy, uz));
                let camera = look_at(eye, look, up)
                    .ok_or_else(|| at.fault("the eye is at the target, or the target straight up or down from it"))?;
                self.state.transform(|ctm| *ctm * camera);
            }
            "Transform" | "ConcatTransform" => {
                let matrix = from_columns(&numbers(tokens, at, word)?, at)?;
                match word {
                    "Transform" => self.state.transform(|_| matrix),
                    _ => self.state.transform(|ctm| *ctm * matrix),
                }
            }
            "CoordinateSystem" => {
                let (name, _) = text(tokens, at, word)?;
                self.coordinate_systems.insert(name, self.state.ctm);
            }
            "CoordSysTransform" => {
                let (name, name_at) = text(tokens, at, word)?;
                match self.coordinate_systems.get(&name) {
                    Some(ctm) => self.state.ctm = *ctm,
                    None => {
                        let problem = format!("there is no coordinate system \"{}\"", shortened(&name));
                        return Err(name_at.fault(problem).into());
                    }
                }
            }
            "ActiveTransform" => match tokens.next()? {
                Some((Token::Word(which), _)) if which == "All" => self.state.active = [true; 2],
                Some((Token::Word(which), _)) if which == "StartTime" => self.state.active = [true, false],
                Some((Token::Word(which), _)) if which == "EndTime" => self.state.active = [false, true],
                _ => return Err(at.fault("ActiveTransform is All, StartTime or EndTime").into()),
            },
            _ => {
                let [start, end]: [f64; 2] = numbers(tokens, at, word)?;
                if !(start < end && start.is_finite() && end.is_finite()) {
                    return Err(at.fault("TransformTimes needs an earlier and a later time").into());
                }
                self.world.transform_times = Some([start, end]);
            }
        }
        if self.state.ctm.iter().all(DAffine3::is_finite) {
            Ok(())
        } else {
            Err(at.fault("the transformation exceeds all bounds").into())
        }
    }
}

/// Reads the numbers that follow a directive, with or without brackets.
fn numbers<const N: usize>(tokens: &mut Tokens<'_>, at: TextPlace, word: &str) -> Result<[f64; N], TextFault> {
    let mut numbers = [0.0; N];
    let has_brackets = matches!(tokens.peek()?, Some((Token::Open, _)));
    if has_brackets {
        tokens.next()?;
    }
    let wrong = |at: TextPlace| at.fault(format!("{word} is followed by {N} numbers"));
    for value in &mut numbers {
        *value = match tokens.next()? {
            Some((Token::Word(word), at)) => number(&word).ok_or_else(|| wrong(at))?,
            Some((_, at)) => return Err(wrong(at)),
            None => return Err(ended(at, word)),
        };
    }
    if has_brackets {
        match tokens.next()? {
            Some((Token::Close, _)) => {}
            Some((_, at)) => return Err(wrong(at)),
            None => return Err(ended(at, word)),
        }
    }
    Ok(numbers)
}
