//! The JSON schemas of the channels: those of Foxglove where they fit, and plain objects of numbers.

use serde_json::{Map, Value, json};

/// The parts of a pose in the schemas of Foxglove.
pub(crate) const POSITION: &str = "position";
pub(crate) const ORIENTATION: &str = "orientation";

/// The name and the text of a schema.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Schema {
    pub(crate) name: String,
    pub(crate) text: String,
}

impl Schema {
    /// Describes an object with these properties.
    pub(crate) fn object(name: &str, description: &str, properties: &[(&str, Value)]) -> Self {
        let mut text = object(name, properties);
        text["description"] = description.into();
        Self { name: name.to_owned(), text: text.to_string() }
    }

    /// The schema of tactile images and masks, `foxglove.Grid`.
    pub(crate) fn grid() -> Self {
        let field = object(
            "foxglove.PackedElementField",
            &[("name", json!({"type": "string"})), ("offset", integer()), ("type", numeric_type())],
        );
        Self::object(
            "foxglove.Grid",
            "A 2D grid of data",
            &[
                ("timestamp", time()),
                ("frame_id", json!({"type": "string", "description": "Frame of reference"})),
                ("pose", pose()),
                ("column_count", integer()),
                ("cell_size", vector("foxglove.Vector2", &["x", "y"])),
                ("row_stride", integer()),
                ("cell_stride", integer()),
                ("fields", json!({"type": "array", "items": field})),
                ("data", json!({"type": "string", "contentEncoding": "base64"})),
            ],
        )
    }

    /// The schema of poses, `foxglove.PoseInFrame`.
    pub(crate) fn pose_in_frame() -> Self {
        let frame = json!({"type": "string", "description": "Frame of reference for pose position and orientation"});
        let properties = [("timestamp", time()), ("frame_id", frame), ("pose", pose())];
        Self::object("foxglove.PoseInFrame", "A timestamped pose in 3D space", &properties)
    }

    /// The schema of the frames that poses move, `foxglove.FrameTransform`.
    pub(crate) fn frame_transform() -> Self {
        let frame = |what: &str| json!({"type": "string", "description": what});
        let properties = [
            ("timestamp", time()),
            ("parent_frame_id", frame("Name of the parent frame")),
            ("child_frame_id", frame("Name of the child frame")),
            ("translation", vector("foxglove.Vector3", &["x", "y", "z"])),
            ("rotation", vector("foxglove.Quaternion", &["x", "y", "z", "w"])),
        ];
        Self::object("foxglove.FrameTransform", "A transform between two reference frames in 3D space", &properties)
    }

    /// The schema of events, `foxglove.Log`.
    pub(crate) fn log() -> Self {
        let levels = ["UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"];
        let text = json!({"type": "string"});
        let properties = [
            ("timestamp", time()),
            ("level", one_of("foxglove.LogLevel", &levels)),
            ("message", text.clone()),
            ("name", text.clone()),
            ("file", text),
            ("line", integer()),
        ];
        Self::object("foxglove.Log", "A log message", &properties)
    }
}

/// Describes a property that is a number, or null while it is absent.
pub(crate) fn number(description: &str) -> Value {
    json!({"type": ["number", "null"], "description": description})
}

/// Describes a property that is a number in every message.
pub(crate) fn present_number(description: &str) -> Value {
    json!({"type": "number", "description": description})
}

fn object(title: &str, properties: &[(&str, Value)]) -> Value {
    let properties: Map<String, Value> =
        properties.iter().map(|(name, value)| ((*name).into(), value.clone())).collect();
    json!({"title": title, "type": "object", "properties": properties})
}

fn integer() -> Value {
    json!({"type": "integer", "minimum": 0})
}

fn time() -> Value {
    let nanos = json!({"type": "integer", "minimum": 0, "maximum": 999_999_999});
    object("time", &[("sec", integer()), ("nsec", nanos)])
}

fn vector(title: &str, axes: &[&str]) -> Value {
    let axes: Vec<(&str, Value)> = axes.iter().map(|axis| (*axis, json!({"type": "number"}))).collect();
    object(title, &axes)
}

fn pose() -> Value {
    let position = vector("foxglove.Vector3", &["x", "y", "z"]);
    let orientation = vector("foxglove.Quaternion", &["x", "y", "z", "w"]);
    object("foxglove.Pose", &[(POSITION, position), (ORIENTATION, orientation)])
}

fn one_of(title: &str, names: &[&str]) -> Value {
    let values: Vec<Value> = names.iter().enumerate().map(|(i, name)| json!({"title": name, "const": i})).collect();
    json!({"title": title, "oneOf": values})
}

fn numeric_type() -> Value {
    let names = ["UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64"];
    one_of("foxglove.NumericType", &names)
}
