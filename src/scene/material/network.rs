//! Shading networks to operations: which nodes are needed, in which order, and what is not understood.
//!
//! The description has every node behind those that it is connected to, so that one pass backwards finds what is needed
//! and one forwards compiles it: nothing recurses, whatever a file says. What one node computes is in `nodes`.

use std::collections::{BTreeMap, BTreeSet};

use crate::error::{Error, Result};
use crate::scene::description::{Node, NodeOutput, Shader};
use crate::texture::{Builder, Register};

use super::nodes::{self, Inputs};
use super::resources::Resources;

/// Nodes of one material.
const MOST_NODES: usize = 4096;

/// Why a node has no operations.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Obstacle {
    /// A node is none that is known, or something about it is not.
    Unknown(String),
    /// There are too many of them.
    TooLarge,
}

impl std::fmt::Display for Obstacle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unknown(what) => f.write_str(what),
            Self::TooLarge => f.write_str("the network is too large"),
        }
    }
}

/// The networks of one shader, compiled: the register of each driven input.
#[derive(Debug, Default)]
pub(super) struct Networks {
    /// The operations of all of them.
    pub(super) builder: Builder,
    inputs: BTreeMap<String, Result<Register, Obstacle>>,
}

impl Networks {
    /// Compiles what drives the inputs of `shader`, by the nodes of its material.
    pub(super) fn compile(shader: &Shader, nodes: &[Node], resources: &mut Resources<'_>) -> Result<Self> {
        let mut networks = Self::default();
        if shader.networks.is_empty() {
            return Ok(networks);
        }
        let order = needed(shader, nodes)?;
        let mut known: BTreeMap<&NodeOutput, Result<Register, Obstacle>> = BTreeMap::new();
        for output in order {
            let node = &nodes[output.node];
            let inputs = Inputs { node, known: &known };
            let register = nodes::compile(&inputs, &output.output, &mut networks.builder, resources)?;
            known.insert(output, register);
        }
        for (name, output) in &shader.networks {
            networks.inputs.insert(name.clone(), known[output].clone());
        }
        Ok(networks)
    }

    /// What computes the input `name`, if something does that is understood.
    pub(super) fn register(&self, name: &str) -> Option<Register> {
        self.inputs.get(name)?.clone().ok()
    }

    /// Why the input `name` cannot be computed.
    pub(super) fn obstacle(&self, name: &str) -> Option<&Obstacle> {
        self.inputs.get(name)?.as_ref().err()
    }
}

/// The outputs that the inputs of `shader` come from, each behind those that it comes from itself.
fn needed<'a>(shader: &'a Shader, nodes: &'a [Node]) -> Result<Vec<&'a NodeOutput>> {
    let damaged = |place: &str, problem: String| {
        Err(Error::scene(format!("<{place}>"), format!("{problem}: the scene file is damaged, export it again")))
    };
    if nodes.len() > MOST_NODES {
        return damaged(&shader.path, format!("has {} nodes, more than {MOST_NODES}", nodes.len()));
    }
    let mut wanted: Vec<BTreeSet<&NodeOutput>> = vec![BTreeSet::new(); nodes.len()];
    for output in shader.networks.values() {
        if output.node >= nodes.len() {
            return damaged(&shader.path, format!("is driven by node {} of {}", output.node, nodes.len()));
        }
        wanted[output.node].insert(output);
    }
    for i in (0..nodes.len()).rev() {
        if wanted[i].is_empty() {
            continue;
        }
        for source in nodes[i].connected.values() {
            if source.node >= i {
                return damaged(&nodes[i].path, format!("node {i} is driven by node {}", source.node));
            }
            wanted[source.node].insert(source);
        }
    }
    Ok(wanted.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::super::{Context, Material, ScalarIor, compile};
    use super::*;
    use crate::diagnostics::Diagnostics;
    use crate::scene::description::{self, Description};
    use crate::texture::Store;

    const CONTEXT: Context = Context { scalar_ior: ScalarIor::Constant, meters_per_unit: 1.0 };

    /// A material whose diffuse colour is the output `out` of the node `driver`.
    fn compiled(nodes: &Value, driver: usize) -> crate::Result<(Material, Diagnostics)> {
        let document = json!({
            "format": description::FORMAT, "version": description::VERSION,
            "stage": {"source": "", "meters_per_unit": 1.0, "up_axis": "Y"},
            "shapes": [], "groups": [], "root": 0, "materials": [], "cameras": [],
            "textures": [{"place": "</M/T>.inputs:file", "asset": {"path": "t.png"}}],
        });
        let document = serde_json::from_value(document).expect("is a document");
        let description = Description { document, arrays: BTreeMap::new() };
        let material = serde_json::from_value(json!({
            "path": "/M", "nodes": nodes,
            "surface": {
                "path": "/M/S", "id": "UsdPreviewSurface", "terminal": "outputs:surface",
                "connected": {"diffuseColor": "/M/N.outputs:out"},
                "networks": {"diffuseColor": {"node": driver, "output": "out"}},
            },
        }))
        .expect("is a material");
        let mut diagnostics = Diagnostics::default();
        let material = compile(&material, &CONTEXT, &mut Resources::new(&description), &mut diagnostics)?;
        Ok((material, diagnostics))
    }

    fn number(value: f64) -> Value {
        json!({"type": "float", "value": value})
    }

    fn refused(nodes: &Value, driver: usize) -> String {
        compiled(nodes, driver).expect_err("is damaged").to_string()
    }

    #[test]
    fn a_damaged_network_is_refused_and_never_followed() {
        let add = |source: usize| json!({"path": "/M/N", "id": "ND_add_color3", "connected": {"in1": {"node": source, "output": "out"}}});
        assert!(refused(&json!([]), 0).starts_with("</M/S>: is driven by node 0 of 0"));
        // Itself, a later one, and one that is not there.
        for source in [0, 1, 7] {
            assert!(refused(&json!([add(source)]), 0).starts_with("</M/N>: node 0 is driven by node"), "{source}");
        }
        let image = json!([{"path": "/M/T", "id": "UsdUVTexture", "textures": {"file": 9}}]);
        assert!(refused(&image, 0).starts_with("</M/T>: refers to texture 9 of 1"));
        let many: Vec<_> = (0..MOST_NODES + 1).map(|i| add(i.saturating_sub(1))).collect();
        assert!(refused(&json!(many), 0).contains("more than 4096"));
    }

    #[test]
    fn the_longest_chain_of_nodes_needs_no_stack() {
        let first = json!({"path": "/M/N", "id": "ND_constant_float", "inputs": {"value": number(1.0)}});
        let add = |i: usize| {
            json!({"path": "/M/N", "id": "ND_add_float", "inputs": {"in2": number(1.0)},
                "connected": {"in1": {"node": i - 1, "output": "out"}}})
        };
        let chain: Vec<_> = std::iter::once(first).chain((1..MOST_NODES).map(add)).collect();
        let (material, diagnostics) = compiled(&json!(chain), MOST_NODES - 1).expect("is sound");
        // Too many operations for one material: its default, and a word about it.
        assert_eq!(diagnostics.warnings()[0].kind, "unread-network");
        assert_eq!(material.appearance.albedo.as_constant(), Some([0.18, 0.18, 0.18, 1.0]));
        let (material, _) = compiled(&json!(chain), 100).expect("is sound");
        assert_eq!(material.appearance.albedo.as_constant(), Some([101.0; 4]));
    }

    #[test]
    fn what_is_not_understood_is_named_with_its_node() {
        let nodes = json!([
            {"path": "/M/Noise", "id": "ND_noise3d_color3"},
            {"path": "/M/N", "id": "ND_invert_color3", "connected": {"in": {"node": 0, "output": "out"}}},
        ]);
        let (material, diagnostics) = compiled(&nodes, 1).expect("is sound");
        let warning = diagnostics.warnings()[0].to_string();
        assert!(warning.contains("a network that is not understood (the node 'ND_noise3d_color3')"), "{warning}");
        assert_eq!(material.appearance.albedo.at(&Store::default(), |_| None)[0].to_bits(), 0.18_f32.to_bits());
    }
}
