//! What a program states of itself: its ports, its parameters, their units and their documentation.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};
use tactflow_runtime::signal::{FeaturesShape, ImageShape, Kind, Unit, VectorImageShape};

/// Version of the protocol.
pub(crate) const VERSION: u32 = 1;
/// Maximum number of tactels of an image.
const MAX_TACTELS: usize = 1 << 22;

/// The signature of a program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Signature {
    /// Version of the protocol.
    pub(crate) tactflow: u32,
    pub(crate) name: String,
    #[serde(default)]
    pub(crate) doc: String,
    #[serde(default)]
    pub(crate) inputs: Vec<PortText>,
    #[serde(default)]
    pub(crate) outputs: Vec<PortText>,
    #[serde(default)]
    pub(crate) params: Vec<ParamText>,
}

/// A port as a program states it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PortText {
    pub(crate) name: String,
    pub(crate) kind: String,
    /// Unit of a scalar or an image; an input without one takes any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) unit: Option<String>,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) doc: String,
    /// Size of an image that is an output.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) rows: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) cols: Option<usize>,
    /// Distance between the centres of two tactels along x and y [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) pitch: Option<[f64; 2]>,
    /// Names and units of the components of features.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) features: Vec<FeatureText>,
}

/// A component of features.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FeatureText {
    pub(crate) name: String,
    pub(crate) unit: String,
}

/// A parameter as a program states it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ParamText {
    pub(crate) name: String,
    pub(crate) default: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) unit: Option<String>,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(crate) doc: String,
}

/// What an output of a program carries.
#[derive(Debug, Clone)]
pub(crate) enum OutputShape {
    Scalar(Unit),
    Flag,
    Features(FeaturesShape),
    Image(ImageShape),
    VectorImage(VectorImageShape),
}

/// A pad that a program is: the shape of its image, and whether it has three axes.
#[derive(Debug, Clone)]
pub(crate) struct PadShape {
    pub(crate) image: ImageShape,
    pub(crate) has_three_axes: bool,
}

impl Signature {
    /// Reads the line of a program.
    pub(crate) fn from_line(line: &str) -> Result<Self, String> {
        #[derive(Deserialize)]
        struct Versioned {
            tactflow: u32,
        }
        let is_object = line.trim_start().starts_with('{');
        if let Some(Versioned { tactflow }) = serde_json::from_str(line).ok().filter(|_| is_object) {
            check_version(tactflow)?;
        }
        let mut json = serde_json::Deserializer::from_str(line);
        let read: Result<Self, _> = serde_path_to_error::deserialize(&mut json);
        let signature = read.map_err(|error| {
            let (path, why) = (error.path().to_string(), error.inner().to_string());
            if path == "." { why } else { format!("`{path}`: {why}") }
        })?;
        signature.check()?;
        Ok(signature)
    }

    /// Reads the file.
    pub(crate) fn from_toml(text: &str) -> Result<Self, String> {
        let signature: Self = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        check_version(signature.tactflow)?;
        signature.check()?;
        Ok(signature)
    }

    /// Checks what a wrong text can state.
    fn check(&self) -> Result<(), String> {
        names(self.inputs.iter().map(|port| &port.name), "inputs")?;
        names(self.outputs.iter().map(|port| &port.name), "outputs")?;
        names(self.params.iter().map(|param| &param.name), "parameters")?;
        for param in &self.params {
            if !param.default.is_finite() {
                return Err(format!("the default of `{}` is not a finite number", param.name));
            }
        }
        if self.outputs.is_empty() {
            return Err("it states no output".to_owned());
        }
        self.inputs.iter().try_for_each(|port| port.input().map(drop))?;
        self.outputs.iter().try_for_each(|port| port.output().map(drop))
    }

    /// Returns what differs from the signature that the program states now; `None` if they agree. Documentation may
    /// differ.
    pub(crate) fn differs_from(&self, stated: &Self) -> Option<String> {
        if self.name != stated.name {
            return Some(format!("the program is `{}`, and the file is that of `{}`", stated.name, self.name));
        }
        let ports = |ports: &[PortText]| -> Vec<(String, String)> {
            ports.iter().map(|port| (port.name.clone(), port.without_doc())).collect()
        };
        let params = |params: &[ParamText]| -> Vec<(String, String)> {
            let text = |param: &ParamText| format!("{} {}", param.default, param.unit.as_deref().unwrap_or_default());
            params.iter().map(|param| (param.name.clone(), text(param))).collect()
        };
        let lists = [
            ("input", ports(&self.inputs), ports(&stated.inputs)),
            ("output", ports(&self.outputs), ports(&stated.outputs)),
            ("parameter", params(&self.params), params(&stated.params)),
        ];
        lists.into_iter().find_map(|(what, file, now)| difference(what, &file, &now))
    }

    /// Returns the pad that the program is, if it is one.
    pub(crate) fn pad(&self) -> Option<PadShape> {
        let ([port], true) = (&self.outputs[..], self.inputs.is_empty()) else { return None };
        match (&*port.name, port.output().ok()?) {
            ("image", OutputShape::Image(image)) => Some(PadShape { image, has_three_axes: false }),
            ("vectors", OutputShape::VectorImage(shape)) => Some(PadShape { image: shape.0, has_three_axes: true }),
            _ => None,
        }
    }
}

fn difference(what: &str, file: &[(String, String)], now: &[(String, String)]) -> Option<String> {
    for (name, text) in file {
        match now.iter().find(|(other, _)| other == name) {
            None => return Some(format!("the program has no {what} `{name}`, and the file has one")),
            Some((_, other)) if other != text => {
                return Some(format!("the {what} `{name}` is {other} in the program, and {text} in the file"));
            }
            Some(_) => {}
        }
    }
    let new = now.iter().find(|(name, _)| !file.iter().any(|(other, _)| other == name));
    let new = new.map(|(name, _)| format!("the program has the {what} `{name}`, and the file has none"));
    new.or_else(|| (file != now).then(|| format!("the {what}s are in another order in the program than in the file")))
}

impl PortText {
    /// Returns the kind of an input.
    pub(crate) fn input(&self) -> Result<Kind, String> {
        const KINDS: [Kind; 8] = [
            Kind::Scalar,
            Kind::Flag,
            Kind::Features,
            Kind::Image,
            Kind::VectorImage,
            Kind::Mask,
            Kind::Twist,
            Kind::Joints,
        ];
        let kind = KINDS.into_iter().find(|kind| kind.name() == self.kind);
        let kind = kind.ok_or_else(|| {
            let known: Vec<String> = KINDS.iter().map(|kind| format!("`{}`", kind.name())).collect();
            format!("the kind of input `{}` is `{}`, and not one of {}", self.name, self.kind, known.join(", "))
        })?;
        let has_unit = kind.arguments().contains(&"unit") && kind != Kind::Features;
        self.has_only("input", if has_unit { &["unit"] } else { &[] })?;
        self.unit.as_deref().map_or(Ok(()), |unit| parse(&self.name, unit).map(drop))?;
        Ok(kind)
    }

    /// Refuses a key that means nothing for a port of this kind.
    fn has_only(&self, direction: &str, known: &[&str]) -> Result<(), String> {
        let stated = [
            ("unit", self.unit.is_some()),
            ("rows", self.rows.is_some()),
            ("cols", self.cols.is_some()),
            ("pitch", self.pitch.is_some()),
            ("features", !self.features.is_empty()),
        ];
        match stated.iter().find(|(key, is_stated)| *is_stated && !known.contains(key)) {
            Some((key, _)) => {
                let Self { name, kind, .. } = self;
                Err(format!("`{key}` means nothing for the {direction} `{name}`, which is of kind `{kind}`: remove it"))
            }
            None => Ok(()),
        }
    }

    /// Returns what an output carries.
    pub(crate) fn output(&self) -> Result<OutputShape, String> {
        let name = &self.name;
        let unit = || {
            let unit = self.unit.as_deref().ok_or_else(|| format!("output `{name}` has no `unit`: `1` is one too"))?;
            parse(name, unit)
        };
        let has_only = |known: &[&str]| self.has_only("output", known);
        match &*self.kind {
            "scalar" => has_only(&["unit"]).and_then(|()| unit()).map(OutputShape::Scalar),
            "flag" => has_only(&[]).map(|()| OutputShape::Flag),
            "features" if self.features.is_empty() => Err(format!("output `{name}` names no `features`")),
            "features" => {
                has_only(&["features"])?;
                names(self.features.iter().map(|feature| &feature.name), "features")?;
                let units = self
                    .features
                    .iter()
                    .map(|feature| Ok((feature.name.as_str(), parse(&feature.name, &feature.unit)?)));
                let units: Result<Vec<_>, String> = units.collect();
                Ok(OutputShape::Features(FeaturesShape::new(units?)))
            }
            "image" => self.image(unit).map(OutputShape::Image),
            "vector_image" => self.image(unit).map(|image| OutputShape::VectorImage(VectorImageShape(image))),
            "twist" | "pose" | "joints" | "jacobian" => Err(format!(
                "output `{name}` is a {}: a program gives features, and no motion of an arm, because nothing outside of \
                 it would stop the motion when it hangs",
                self.kind
            )),
            kind => Err(format!(
                "the kind of output `{name}` is `{kind}`, and not one of `scalar`, `flag`, `features`, `image`, \
                 `vector_image`"
            )),
        }
    }

    /// Returns the shape of an image that is an output, also of one axis of a vector image.
    fn image(&self, unit: impl FnOnce() -> Result<Unit, String>) -> Result<ImageShape, String> {
        let name = &self.name;
        self.has_only("output", &["unit", "rows", "cols", "pitch"])?;
        let (Some(rows), Some(cols), Some(pitch)) = (self.rows, self.cols, self.pitch) else {
            return Err(format!("the image `{name}` needs `rows`, `cols` and `pitch`"));
        };
        let tactels = rows.saturating_mul(cols);
        if !(1..=MAX_TACTELS).contains(&tactels) || !pitch.iter().all(|pitch| *pitch > 0.0 && pitch.is_finite()) {
            return Err(format!("the image `{name}` has a size of {rows} by {cols}, at a pitch of {pitch:?} m"));
        }
        Ok(ImageShape { rows, cols, pitch, unit: unit()? })
    }

    fn without_doc(&self) -> String {
        let mut text = self.kind.clone();
        text.extend(self.unit.iter().map(|unit| format!(" in {unit}")));
        text.extend(self.rows.zip(self.cols).map(|(rows, cols)| format!(" of {rows} by {cols} tactels")));
        text.extend(self.pitch.map(|[x, y]| format!(" at {x} m by {y} m")));
        let features: Vec<String> = self.features.iter().map(|part| format!("{} [{}]", part.name, part.unit)).collect();
        if features.is_empty() { text } else { format!("{text} ({})", features.join(", ")) }
    }
}

fn check_version(version: u32) -> Result<(), String> {
    if version == VERSION {
        return Ok(());
    }
    Err(format!("it speaks version {version} of the protocol, and this tool speaks version {VERSION}"))
}

fn parse(name: &str, unit: &str) -> Result<Unit, String> {
    unit.parse().map_err(|why| format!("the unit of `{name}`: {why}"))
}

/// Checks names of one kind of thing: each is valid, and no two are the same.
fn names<'n>(names: impl Iterator<Item = &'n String>, what: &str) -> Result<(), String> {
    let mut seen = BTreeSet::new();
    for name in names {
        is_name(name)?;
        if !seen.insert(name) {
            return Err(format!("two {what} have the name `{name}`"));
        }
    }
    Ok(())
}

fn is_name(name: &str) -> Result<(), String> {
    let is_right = name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    if is_right {
        return Ok(());
    }
    Err(format!("`{name}` is not a valid name: it has lower-case letters, digits and `_`, and starts with a letter"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_mistake_in_a_signature_is_named() {
        let whole = |input: &str, output: &str, params: &str| {
            Signature::from_line(&format!(
                r#"{{"tactflow":1,"name":"a","inputs":[{{"name":"i",{input}}}],"outputs":[{{"name":"o",{output}}}],"params":[{params}]}}"#
            ))
        };
        let (image, metres) = (r#""kind":"image""#, r#""kind":"scalar","unit":"m""#);
        assert!(whole(image, metres, "").is_ok());
        let (x, part) = (r#"{"name":"x","default":1}"#, r#"{"name":"b","unit":"m"}"#);
        for (found, why) in [
            (whole(image, metres, &format!("{x},{x}")), "two parameters have the name `x`"),
            (
                whole(image, &format!(r#""kind":"features","features":[{part},{part}]"#), ""),
                "two features have the name `b`",
            ),
            (
                whole(image, r#""kind":"flag","unit":"m""#, ""),
                "`unit` means nothing for the output `o`, which is of kind `flag`",
            ),
            (whole(image, &format!(r#"{metres},"rows":3"#), ""), "`rows` means nothing for the output `o`"),
            (whole(&format!(r#"{image},"cols":3"#), metres, ""), "`cols` means nothing for the input `i`"),
            (
                whole(r#""kind":"mask","unit":"N""#, metres, ""),
                "`unit` means nothing for the input `i`, which is of kind `mask`",
            ),
            (whole(r#""kind":"pose""#, metres, ""), "the kind of input `i` is `pose`, and not one of `scalar`"),
            (whole(image, r#""kind":"scalar""#, ""), "output `o` has no `unit`"),
            (whole(image, r#""kind":"twist","unit":"m/s""#, ""), "no motion of an arm"),
            (whole(image, metres, r#"{"name":"X","default":1}"#), "`X` is not a valid name"),
        ] {
            let said = found.unwrap_err();
            assert!(said.contains(why), "{said}");
        }
    }
}
