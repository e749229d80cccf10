//! Charts of each kind of result, from the marks and axes of `needlebench_show::chart`.

pub mod atlas;
pub mod budget;
pub mod iso9283;
pub mod press;
pub mod ranking;
pub mod replay;
pub mod routes;
pub mod servo;
mod skin_map;
pub mod suggest;
