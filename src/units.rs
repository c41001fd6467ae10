//! Physical dimensions and quantities with units, as they stand in input files.
