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
    /// The node with this path and identifier is none that is known, or has inputs that are not.
    Unknown {
        /// Prim path.
        path: String,
        /// `info:id`, and what of it.
        what: String,
    },
    /// There are too many of them.
    TooLarge,
}

impl std::fmt::Display for Obstacle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unknown { path, what } => write!(f, "{what} of <{path}> is not understood"),
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
