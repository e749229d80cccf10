//! Which detected marker is which known one.

use nalgebra::{Matrix3, Point3, Vector3};
use needlebench_kinematics::registration::{
    FEWEST_FIDUCIALS, Localised, RegistrationError, register, register_weighted,
};
use needlebench_volume::{Remark, VolumeError};
use serde::{Deserialize, Serialize};

use super::{ReferenceMarker, refused};

/// How markers are matched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MatchOptions {
    /// How far a marker may be from where it is said to be, one standard deviation along each axis: added to the
    /// stated covariances for the matching alone. It keeps a moved marker matched, so that the registration can name it.
    pub placement_sigma_m: f64,
    /// Chi-square that leaving out a marker counts as much as: one that fits worse is missing. 30 is exceeded by one
    /// in a million (three degrees of freedom).
    pub left_out_chi_square: f64,
}

impl Default for MatchOptions {
    fn default() -> Self {
        Self {
            placement_sigma_m: 5e-4,
            left_out_chi_square: 30.0,
        }
    }
}

/// A detected marker and the known one that it is, by their places in the lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct MatchedPair {
    /// Known marker.
    pub reference: usize,
    /// Detected marker.
    pub detected: usize,
}

/// Another match that contradicts the best one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Alternative {
    /// Its pairs, in the order of the known markers.
    pub pairs: Vec<MatchedPair>,
    /// Of its fit, with the placement's standard deviation.
    pub chi_square: f64,
    /// Square root of how much worse it is in chi-square, missing markers counted in.
    pub separation_sigmas: f64,
}

/// Which detected marker is which known one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MarkerMatch {
    /// In the order of the known markers.
    pub pairs: Vec<MatchedPair>,
    /// Known markers that were not detected.
    pub missing: Vec<usize>,
    /// Detected markers that are none of the known ones.
    pub unknown: Vec<usize>,
    /// Of the fit, with the placement's standard deviation: a measure of the match alone.
    pub chi_square: f64,
    /// The next best match that contradicts this one, if any is within ten sigmas.
    pub second_best: Option<Alternative>,
    /// What is worth knowing of it.
    pub remarks: Vec<Remark>,
}

/// Matches that are this much worse are none, in sigmas.
const SEPARATION_OF_INTEREST: f64 = 10.0;

/// Below this the best match is not certain, in sigmas.
const CERTAIN_SIGMAS: f64 = 3.0;

/// Below this the best match is a toss of a coin, in sigmas.
const TOSS_SIGMAS: f64 = 1.0;

/// Steps of the search after which it is given up: seconds, and never reached by sets that can be told apart.
const MOST_STEPS: usize = 300_000;

/// Most markers of a side: their pairs of pairs are kept.
const MOST_MARKERS: usize = 64;

/// Finds out which detected marker is which known one, by distances: any order, missing and false ones.
///
/// The match with the least chi-square, where leaving a known marker out costs `left_out_chi_square`: pairs of pairs
/// whose distances differ by more can be in no best match, and of the others branch and bound finds the best one. Only
/// rotations count: the mirror image of a set fits its distances as well, and is told apart by its determinant.
///
/// # Errors
/// Fewer than three markers that fit, known markers on a line, a match that cannot be told from another one (less than
/// one sigma), a mirrored volume, too many candidates.
pub fn match_markers(
    detected: &[Localised],
    reference: &[ReferenceMarker],
    options: &MatchOptions,
) -> Result<MarkerMatch, VolumeError> {
    check(detected, reference, options)?;
    let known: Vec<Localised> = reference
        .iter()
        .map(|marker| {
            let slack = options.placement_sigma_m * options.placement_sigma_m;
            Localised {
                at_m: marker.center_m,
                covariance_m2: marker.covariance_m2 + Matrix3::from_diagonal_element(slack),
            }
        })
        .collect();
    let search = Search::new(detected, &known, options.left_out_chi_square);
    let mirrored_known: Vec<Localised> = known.iter().map(mirrored).collect();
    let mirrored_search = Search::new(detected, &mirrored_known, options.left_out_chi_square);
    let best = search.best(&[], f64::INFINITY)?;
    let mirror =
        mirrored_search.best(&[], best.as_ref().map_or(f64::INFINITY, |b| b.cost + 9.0))?;
    let Some(best) = best else {
        return Err(match mirror {
            Some(mirror) if mirror.pairs.len() > FEWEST_FIDUCIALS => mirror_error(&mirror),
            _ => too_few(detected.len(), reference.len()),
        });
    };
    if let Some(mirror) = &mirror
        && mirror.pairs.len() > FEWEST_FIDUCIALS
        && mirror.cost + CERTAIN_SIGMAS * CERTAIN_SIGMAS < best.cost
    {
        return Err(mirror_error(mirror));
    }
    let second_best = search.contradiction(&best)?.map(|other| Alternative {
        separation_sigmas: (other.cost - best.cost).max(0.0).sqrt(),
        pairs: other.pairs,
        chi_square: other.chi_square,
    });
    let mut remarks = Vec::new();
    if let Some(second) = &second_best {
        judge(&best, second, reference, &mut remarks)?;
    }
    if mirror.is_some() {
        remarks.push(Remark::new(
            "the marker layout is mirror-symmetric within its uncertainty: it cannot detect \
             exchanged left and right",
        ));
    }
    let used = |of: fn(&MatchedPair) -> usize, index| best.pairs.iter().any(|p| of(p) == index);
    let missing: Vec<usize> = (0..reference.len())
        .filter(|&i| !used(|p| p.reference, i))
        .collect();
    let unknown: Vec<usize> = (0..detected.len())
        .filter(|&i| !used(|p| p.detected, i))
        .collect();
    for &index in &missing {
        remarks.push(missing_remark(
            index, &best, &unknown, detected, &known, reference,
        ));
    }
    Ok(MarkerMatch {
        pairs: best.pairs,
        missing,
        unknown,
        chi_square: best.chi_square,
        second_best,
        remarks,
    })
}

fn check(
    detected: &[Localised],
    reference: &[ReferenceMarker],
    options: &MatchOptions,
) -> Result<(), VolumeError> {
    let positive = |value: f64| value > 0.0 && value.is_finite();
    if !positive(options.placement_sigma_m) || !positive(options.left_out_chi_square) {
        return Err(VolumeError::refused(format!(
            "placement sigma {} m and chi-square of an omitted marker {} must be above 0",
            options.placement_sigma_m, options.left_out_chi_square
        )));
    }
    if detected.len().max(reference.len()) > MOST_MARKERS {
        return Err(VolumeError::refused(format!(
            "{} detected and {} known markers: at most {MOST_MARKERS} of each can be matched",
            detected.len(),
            reference.len()
        )));
    }
    let places: Vec<_> = reference.iter().map(|marker| marker.center_m).collect();
    match register(&places, &places) {
        // Two rotations that fit equally well are found by the search, which says which ones.
        Ok(_) | Err(RegistrationError::Ambiguous) => {}
        Err(error) => return Err(refused(error, |index| reference[index].name.clone())),
    }
    if detected.len() < FEWEST_FIDUCIALS {
        return Err(too_few(detected.len(), reference.len()));
    }
    // What covariances have to be is checked where they are used: here, all in one fit of the set to itself.
    let named = |list: Vec<Localised>| register_weighted(&list, &list).err();
    for (list, what) in [
        (
            reference
                .iter()
                .map(ReferenceMarker::localised)
                .collect::<Vec<_>>(),
            "known",
        ),
        (detected.to_vec(), "detected"),
    ] {
        let widened = list
            .iter()
            .map(|point| Localised {
                at_m: point.at_m,
                covariance_m2: point.covariance_m2 + Matrix3::from_diagonal_element(1e-12),
            })
            .collect();
        if let Some(
            error @ (RegistrationError::BadCovariance { index }
            | RegistrationError::BadCoordinate { index, .. }),
        ) = named(widened)
        {
            return Err(
                VolumeError::refused(error.to_string()).at(format!("{what} marker {}", index + 1))
            );
        }
    }
    Ok(())
}

fn too_few(detected: usize, reference: usize) -> VolumeError {
    VolumeError::refused(format!(
        "fewer than {FEWEST_FIDUCIALS} of {detected} detected and {reference} known markers match"
    ))
    .hint(
        "at least three that are not collinear are required; compare the distances between the \
         detected markers with those of the list, and its unit",
    )
}

fn mirror_error(mirror: &Candidate) -> VolumeError {
    VolumeError::refused(format!(
        "the markers match the mirrored list: {} of them fit with left and right exchanged",
        mirror.pairs.len()
    ))
    .hint(
        "the volume's orientation or the sign of a coordinate in the list is wrong; a flipped patient must not be \
         registered",
    )
}

/// Says how certain the best match is.
fn judge(
    best: &Candidate,
    second: &Alternative,
    reference: &[ReferenceMarker],
    remarks: &mut Vec<Remark>,
) -> Result<(), VolumeError> {
    let differing: Vec<String> = second
        .pairs
        .iter()
        .filter(|pair| !best.pairs.contains(pair))
        .map(|pair| {
            format!(
                "{} = detected {}",
                reference[pair.reference].name,
                pair.detected + 1
            )
        })
        .collect();
    let message = format!(
        "another match is only {:.1} sigma worse: {}",
        second.separation_sigmas,
        differing.join(", ")
    );
    if second.separation_sigmas < TOSS_SIGMAS {
        return Err(VolumeError::refused(message).hint(
            "the layout of the markers, or of those detected, is symmetric: move one marker, or \
             detect more of them",
        ));
    }
    if second.separation_sigmas < CERTAIN_SIGMAS {
        remarks.push(Remark::new(format!("{message}; the match is ambiguous")));
    }
    Ok(())
}

/// Where a missing marker should have been, and what is nearest.
fn missing_remark(
    index: usize,
    best: &Candidate,
    unknown: &[usize],
    detected: &[Localised],
    known: &[Localised],
    reference: &[ReferenceMarker],
) -> Remark {
    let (from, to) = best.points(detected, known);
    let nearest = register_weighted(&from, &to).ok().map(|fit| {
        let wanted = fit.to_from_from.inverse_transform_point(&known[index].at_m);
        let nearest_mm = unknown
            .iter()
            .map(|&other| ((detected[other].at_m - wanted).norm() * 1e3, other))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let place = wanted.coords * 1e3;
        let at = format!(
            "expected at ({:.1}, {:.1}, {:.1}) mm",
            place.x, place.y, place.z
        );
        match nearest_mm {
            Some((mm, other)) if mm < 20.0 => {
                format!(
                    "{at}; detected {} is {mm:.1} mm from there: it may have moved",
                    other + 1
                )
            }
            _ => at,
        }
    });
    Remark::new(format!(
        "not detected{}",
        nearest.map(|text| format!(": {text}")).unwrap_or_default()
    ))
    .at(reference[index].name.clone())
}

fn mirrored(point: &Localised) -> Localised {
    let mirror = Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0));
    Localised {
        at_m: Point3::from(mirror * point.at_m.coords),
        covariance_m2: mirror * point.covariance_m2 * mirror,
    }
}

/// A set of pairs and how well it fits.
#[derive(Debug, Clone)]
struct Candidate {
    pairs: Vec<MatchedPair>,
    chi_square: f64,
    /// Chi-square and the price of markers left out.
    cost: f64,
}

impl Candidate {
    fn points(
        &self,
        detected: &[Localised],
        known: &[Localised],
    ) -> (Vec<Localised>, Vec<Localised>) {
        points(&self.pairs, detected, known)
    }
}

fn points(
    pairs: &[MatchedPair],
    detected: &[Localised],
    known: &[Localised],
) -> (Vec<Localised>, Vec<Localised>) {
    pairs
        .iter()
        .map(|pair| (detected[pair.detected], known[pair.reference]))
        .unzip()
}

/// Branch and bound over known markers: each is one of the detected ones, or missing.
struct Search<'a> {
    detected: &'a [Localised],
    known: &'a [Localised],
    /// Price of a known marker left out.
    left_out: f64,
    /// Whether two pairs keep their distance, by `pair * pairs + pair`.
    agree: Vec<bool>,
}

/// What changes while a search goes on.
struct State {
    pairs: Vec<MatchedPair>,
    used: u64,
    missing: usize,
    best: Option<Candidate>,
    /// Costs from here on are of no interest.
    limit: f64,
    steps: usize,
}

impl<'a> Search<'a> {
    fn new(detected: &'a [Localised], known: &'a [Localised], left_out: f64) -> Self {
        let (rows, columns) = (known.len(), detected.len());
        let pairs = rows * columns;
        let mut agree = vec![false; pairs * pairs];
        for i in 0..rows {
            for j in i + 1..rows {
                let (wanted, wanted_error) = Length::between(&known[i], &known[j]);
                for a in 0..columns {
                    for b in (0..columns).filter(|&b| b != a) {
                        let (seen, seen_error) = Length::between(&detected[a], &detected[b]);
                        let tolerance = wanted_error.plus(&seen_error).within(left_out);
                        let fits = (wanted - seen).abs() <= tolerance;
                        agree[(i * columns + a) * pairs + j * columns + b] = fits;
                        agree[(j * columns + b) * pairs + i * columns + a] = fits;
                    }
                }
            }
        }
        Self {
            detected,
            known,
            left_out,
            agree,
        }
    }

    fn agrees(&self, a: MatchedPair, b: MatchedPair) -> bool {
        let columns = self.detected.len();
        let pairs = self.known.len() * columns;
        self.agree
            [(a.reference * columns + a.detected) * pairs + b.reference * columns + b.detected]
    }

    /// The best set of pairs below a cost that has these pairs.
    fn best(&self, forced: &[MatchedPair], limit: f64) -> Result<Option<Candidate>, VolumeError> {
        let mut state = State {
            pairs: forced.to_vec(),
            used: forced
                .iter()
                .fold(0, |used, pair| used | 1_u64 << pair.detected),
            missing: 0,
            best: None,
            limit,
            steps: 0,
        };
        self.descend(0, None, &mut state)?;
        if let Some(best) = &mut state.best {
            best.pairs.sort();
        }
        Ok(state.best)
    }

    /// The best set of pairs in which a marker of `best` has another partner.
    fn contradiction(&self, best: &Candidate) -> Result<Option<Candidate>, VolumeError> {
        let mut second: Option<Candidate> = None;
        let mut limit = best.cost + SEPARATION_OF_INTEREST * SEPARATION_OF_INTEREST;
        for reference in 0..self.known.len() {
            for detected in 0..self.detected.len() {
                let pair = MatchedPair {
                    reference,
                    detected,
                };
                let contradicts = best
                    .pairs
                    .iter()
                    .any(|p| (p.reference == reference) != (p.detected == detected));
                if contradicts && let Some(found) = self.best(&[pair], limit)? {
                    limit = found.cost;
                    second = Some(found);
                }
            }
        }
        Ok(second)
    }

    /// Decides on known marker `reference` and those after it; `chi_square` is that of the pairs so far.
    fn descend(
        &self,
        reference: usize,
        chi_square: Option<f64>,
        state: &mut State,
    ) -> Result<(), VolumeError> {
        state.steps += 1;
        if state.steps > MOST_STEPS {
            return Err(VolumeError::refused(format!(
                "the distances between {} detected and {} known markers match in too many ways",
                self.detected.len(),
                self.known.len()
            ))
            .hint("place markers at unequal distances, or remove false detections"));
        }
        let price = self.left_out * state.missing as f64;
        if price + chi_square.unwrap_or(0.0) >= state.limit {
            return Ok(());
        }
        if reference == self.known.len() {
            if let Some(chi_square) = chi_square {
                let cost = price + chi_square;
                state.limit = cost;
                state.best = Some(Candidate {
                    pairs: state.pairs.clone(),
                    chi_square,
                    cost,
                });
            }
            return Ok(());
        }
        if state.pairs.iter().any(|pair| pair.reference == reference) {
            return self.descend(reference + 1, chi_square, state);
        }
        for detected in 0..self.detected.len() {
            let pair = MatchedPair {
                reference,
                detected,
            };
            let free = state.used & (1_u64 << detected) == 0;
            if free && state.pairs.iter().all(|&other| self.agrees(pair, other)) {
                state.pairs.push(pair);
                state.used |= 1_u64 << detected;
                self.descend(reference + 1, self.chi_square(&state.pairs), state)?;
                state.used &= !(1_u64 << detected);
                state.pairs.pop();
            }
        }
        state.missing += 1;
        let left = self.known.len() - state.missing;
        if left >= FEWEST_FIDUCIALS {
            self.descend(reference + 1, chi_square, state)?;
        }
        state.missing -= 1;
        Ok(())
    }

    /// Of the fit of these pairs; never less with more pairs. `None` where they determine no transform.
    fn chi_square(&self, pairs: &[MatchedPair]) -> Option<f64> {
        if pairs.len() < FEWEST_FIDUCIALS {
            return None;
        }
        let (from, to) = points(pairs, self.detected, self.known);
        register_weighted(&from, &to).ok().map(|fit| fit.chi_square)
    }
}

/// What a distance between two localised points may be off by.
struct Length {
    /// Variance along it, m^2.
    along_m2: f64,
    /// Largest variance across it over twice its length, m: what it grows by on average.
    across_m: f64,
}

impl Length {
    /// The distance in m, and what it may be off by.
    fn between(a: &Localised, b: &Localised) -> (f64, Self) {
        let offset = b.at_m - a.at_m;
        let length = offset.norm().max(1e-9);
        let along = offset / length;
        let covariance = a.covariance_m2 + b.covariance_m2;
        let error = Self {
            along_m2: along.dot(&(covariance * along)),
            across_m: covariance.symmetric_eigenvalues().max() / (2.0 * length),
        };
        (length, error)
    }

    fn plus(&self, other: &Self) -> Self {
        Self {
            along_m2: self.along_m2 + other.along_m2,
            across_m: self.across_m + other.across_m,
        }
    }

    /// Difference beyond which the chi-square of the two points is above `chi_square`.
    fn within(&self, chi_square: f64) -> f64 {
        (chi_square * self.along_m2).sqrt() + chi_square * self.across_m
    }
}

#[cfg(test)]
#[path = "matching_tests.rs"]
mod tests;
