//! Multichannel EXR: layers, types, header, atomic writing, merging.
