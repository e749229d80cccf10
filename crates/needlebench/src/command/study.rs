//! `needlebench study` and `needlebench merge`.
