//! Manipulability and distances to singularities.
