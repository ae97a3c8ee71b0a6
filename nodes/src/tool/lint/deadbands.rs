//! Deadbands in which a feature always rests, or through which an integral moves it.

use tactflow_runtime::source::{Code, Diagnostic, Edit};

use super::arm::Arm;
use super::mode_law::ModeLaw;
use crate::tool::control::digits::to_two_digits;
use crate::tool::control::law::Feature;

/// Returns the warning about a deadband in which a feature always rests, or for good once the contact is lost.
pub(super) fn always_resting(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let band = mode.deadband(feature)?;
    let (name, path) = (&feature.name, format!("width.{}.outer", feature.name));
    let outer = mode.nodes.number(band, &path)?;
    let largest = arm.largest_error(mode, feature);
    let why = match mode.quantity(feature)? {
        "pressure" | "force" if feature.setpoint == Some(largest) => {
            format!("without a contact its error is {largest}, so once it rests it presses no more")
        }
        _ => format!("no error is larger than {largest}, so it rests wherever the contact is"),
    };
    if outer < largest {
        return None;
    }
    let message = format!("`{name}` rests up to an error of {outer}, but {why}");
    let [inner, outer] = [0.05, 0.1].map(|share| to_two_digits(share * largest, libm::floor));
    let help = format!("write widths well below {largest}: `width.{name} = {{ inner = {inner}, outer = {outer} }}`");
    Some(Diagnostic::new(Code::UnreachableSetpoint, mode.place(&band.name, &path), message).help(help))
}

/// Returns the warning about an integral that goes on to move its feature while a deadband lets it rest.
pub(super) fn hunting(mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let (name, band) = (&feature.name, mode.deadband(feature)?);
    mode.nodes.number(band, &format!("width.{name}.outer"))?;
    let inside = mode.nodes.value(band, "inside")?;
    if feature.ki == 0.0 || inside.value.as_str() != Some("zero") {
        return None;
    }
    let message = format!(
        "`{}` makes a small error of `{name}` zero, but its integral stays: it moves `{name}` through the band and out at the \
         other side",
        band.name
    );
    let (place, right) = (inside.value.span.clone(), "\"absent\"");
    let diagnostic = Diagnostic::new(Code::Windup, place.clone(), message);
    Some(diagnostic.help(format!("write `inside = {right}`")).edit(Edit::Replace(place, right.into())))
}
