//! (module packing)
