//! Risk of needle paths: published odds ratios, term by term.

use std::f64::consts::FRAC_PI_2;

use nalgebra::UnitVector3;
use needlebench_scenario::scenario::OddsSection;
use serde::Serialize;

use crate::LungPassage;

/// From what outer diameter on a needle counts as thick: 18 G, m.
const THICK_M: f64 = 1.27e-3;

/// One term of a needle path's risk.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RiskTerm {
    /// Its key under `[goals.route.odds]`.
    pub term: &'static str,
    /// Share of it that the needle path has, from 0 to 1.
    pub share: f64,
    /// Its odds ratio where all of it is there.
    pub odds_ratio: f64,
    /// What it adds: the share of the ratio's logarithm.
    pub log_odds: f64,
}

/// The sum of all terms. It ranks needle paths and is not a probability.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Risk {
    /// Sum of the terms.
    pub log_odds: f64,
    /// The odds ratio relative to a needle path without any of them.
    pub odds_ratio: f64,
    /// All terms, also those that add nothing.
    pub terms: Vec<RiskTerm>,
}

impl Risk {
    /// Of a needle path in a direction, with its lung passage; `touches_pleura` is of the lesion, if it is in a lung.
    pub fn new(
        odds: &OddsSection,
        outwards: &UnitVector3<f64>,
        lungs: &LungPassage,
        touches_pleura: Option<bool>,
        needle_diameter_m: f64,
    ) -> Self {
        let yes = |is: bool| f64::from(u8::from(is));
        let tilt_rad = odds.gantry_tilt_deg.to_radians();
        let [_, elevation_rad] = crate::angles_rad(outwards);
        let out_of_plane_rad = (elevation_rad.abs() - tilt_rad).max(0.0);
        let along_pleura = lungs.pleura_angle_rad.unwrap_or(0.0) / FRAC_PI_2;
        let shares = [
            ("fissure", yes(!lungs.fissures.is_empty()), odds.fissure),
            ("bulla", yes(!lungs.bullae.is_empty()), odds.bulla),
            (
                "second_puncture",
                yes(lungs.entries > 1),
                odds.second_puncture,
            ),
            ("deep", yes(lungs.within_m > odds.deep_mm * 1e-3), odds.deep),
            (
                "no_pleural_contact",
                yes(touches_pleura == Some(false)),
                odds.no_pleural_contact,
            ),
            // Gauges are nominal: within a micrometre it is 18 G.
            (
                "thick_needle",
                yes(needle_diameter_m > THICK_M - 1e-6),
                odds.thick_needle,
            ),
            ("along_pleura", along_pleura, odds.along_pleura),
            (
                "out_of_plane",
                out_of_plane_rad / (FRAC_PI_2 - tilt_rad),
                odds.out_of_plane,
            ),
        ];
        let terms = shares.map(|(term, share, odds_ratio)| RiskTerm {
            term,
            share,
            odds_ratio,
            log_odds: share * libm::log(odds_ratio),
        });
        let log_odds = terms.iter().map(|each| each.log_odds).sum::<f64>();
        Self {
            log_odds,
            odds_ratio: libm::exp(log_odds),
            terms: terms.into(),
        }
    }
}
