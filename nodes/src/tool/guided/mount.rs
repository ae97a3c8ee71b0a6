//! The mount of a pad, as its device states it.

use tactflow_runtime::device::Description;

use crate::arm::mount::Mount;
use crate::devices::pad;

/// Returns where a pad is on the tip of its arm, or `None` if the device states no `mount` for a pad on that side.
pub(crate) fn stated(description: &Description, side: Option<&str>) -> Option<Mount> {
    let fact = |role| description.fact_on(side, role, "mount");
    parse(fact(pad::ROLE).or_else(|| fact(pad::THREE_AXES))?)
}

fn parse(fact: &toml::Value) -> Option<Mount> {
    let three = |name: &str| fact.get(name)?.clone().try_into().ok();
    Some(Mount { xyz: three("xyz")?, rpy: three("rpy")? })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Option<Mount> {
        let table: toml::Table = text.parse().expect("TOML");
        parse(&table["mount"])
    }

    #[test]
    fn a_mount_has_three_numbers_for_each_key() {
        let mount = parsed("mount = { xyz = [0, 0.01, 1e-1], rpy = [0.5, 0, -1] }").expect("it is whole");
        assert_eq!((mount.xyz, mount.rpy), ([0.0, 0.01, 0.1], [0.5, 0.0, -1.0]));
        for text in [
            "mount = { xyz = [0, 0, 0] }",
            "mount = { xyz = [0, 0], rpy = [0, 0, 0] }",
            "mount = { xyz = [0, 0, \"1\"], rpy = [0, 0, 0] }",
            "mount = 3",
        ] {
            assert!(parsed(text).is_none(), "{text}");
        }
    }
}
