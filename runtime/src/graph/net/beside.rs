//! The types of the roles of nodes that compute beside the tick: each follows from the parameters of its block.

use crate::catalogue::Catalogue;
use crate::device::RoleType;
use crate::graph::load::{FlatGraph, role_type_of};
use crate::node::{KnownUnits, Reader};
use crate::source::SourceMap;

/// Returns the type of the role of each node that computes beside the tick. A block with a mistake has none: the mistake
/// is reported when its device is opened.
pub(crate) fn role_types(flat: &FlatGraph, catalogue: &Catalogue, sources: &mut SourceMap) -> Vec<RoleType> {
    let mut types = Vec::new();
    for block in flat.bench.iter().flat_map(|bench| &bench.devices) {
        let Some(kind) = &block.kind else { continue };
        let name = role_type_of(&kind.value, &block.key.name);
        let is_node = flat.roles.get(&block.key.name).is_some_and(|role| role.value == name);
        let Some(device) = catalogue.find_device(&kind.value).filter(|_| is_node) else { continue };
        let specs = device.params();
        let mut reader = Reader::new(sources).with_units(KnownUnits::of_params(&block.params, &specs));
        let role = device.role(&block.params, &mut reader);
        let files = reader.files;
        sources.add_named(files);
        types.extend(role.map(|role| RoleType { name: name.into(), ..role }));
    }
    types
}
