//! Patients, from outside the crate.

mod scan_orders;
