//! needlebench
