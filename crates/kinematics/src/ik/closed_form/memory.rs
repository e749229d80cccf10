//! Answers of the closed form as plain memory, for arrays of other languages.

use std::mem::size_of;

use super::ClosedForm;
use crate::ik::Certificate;

impl ClosedForm {
    /// Doubles that one answer takes. The first 48 are joint positions in rad, by joint and then by the index of a
    /// configuration in [`Configuration::ALL`](crate::ik::Configuration::ALL): the strides of joints by
    /// configuration are 8 and 64 bytes. In the last one stand, byte by byte, the bits of the configurations that exist,
    /// are merged, have a free wrist 3, and touch, and the number of the [`Certificate`].
    pub const DOUBLES: usize = size_of::<Self>() / size_of::<f64>();

    /// Places of what follows the joint positions, in bytes from the beginning of an answer: exists, merged, free,
    /// touching, certificate.
    pub const BYTES: [usize; 5] = [384, 385, 386, 387, 388];

    /// Makes joint positions of configurations that do not exist NaN, so that nobody takes them for postures. All
    /// else says so by bits and leaves there what the computation left.
    pub fn blank_missing(&mut self) {
        if self.exists == u8::MAX {
            return;
        }
        for row in (0..8).filter(|row| (self.exists >> row) & 1 == 0) {
            for joint in &mut self.joints {
                joint[row] = f64::NAN;
            }
        }
    }

    /// Answers as doubles, [`ClosedForm::DOUBLES`] each, in the same memory.
    pub fn into_doubles(answers: Vec<Self>) -> Vec<f64> {
        bytemuck::cast_vec(answers)
    }

    /// Memory that [`ClosedForm::into_doubles`] made as answers again; none if it is not of whole answers.
    pub fn of_doubles(doubles: &mut [f64]) -> Option<&mut [Self]> {
        bytemuck::checked::try_cast_slice_mut(doubles).ok()
    }
}

impl Certificate {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 7] = [
        Self::Complete,
        Self::DecidedInExtendedPrecision,
        Self::MergedBranches,
        Self::FreeJoint,
        Self::Refined,
        Self::NearestOnly,
        Self::NotAPose,
    ];

    /// Name in answers for programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::DecidedInExtendedPrecision => "decided_in_extended_precision",
            Self::MergedBranches => "merged_branches",
            Self::FreeJoint => "free_joint",
            Self::NearestOnly => "nearest_only",
            Self::Refined => "refined",
            Self::NotAPose => "not_a_pose",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ik::{Configuration, closed_form};
    use crate::{Joints, UrGeometry};

    #[test]
    fn memory_holds_what_the_functions_say() {
        let geometry = UrGeometry::UR3;
        // Of the stretched arm all but the elbow is there; beyond its reach nothing is.
        let generic = Joints::from_column_slice(&[-0.7, 2.4, 1.9, -2.0, 1.3, 0.1]);
        let mut far = geometry.base_from_flange(&generic);
        far.translation.vector *= 3.0;
        let poses = [geometry.base_from_flange(&generic), far];
        let answers = poses.map(|pose| closed_form(&geometry, &pose, None));
        let mut memory = answers.to_vec();
        memory.iter_mut().for_each(ClosedForm::blank_missing);
        let mut doubles = ClosedForm::into_doubles(memory);
        assert_eq!(doubles.len(), answers.len() * ClosedForm::DOUBLES);
        for (answer, memory) in answers.iter().zip(doubles.chunks(ClosedForm::DOUBLES)) {
            let bytes: Vec<u8> = memory.iter().flat_map(|each| each.to_ne_bytes()).collect();
            let [exists, merged, free, touching, certificate] = ClosedForm::BYTES;
            assert_eq!(
                Certificate::ALL[usize::from(bytes[certificate])],
                answer.certificate()
            );
            for (row, configuration) in Configuration::ALL.into_iter().enumerate() {
                let joints = Joints::from_fn(|joint, _| memory[8 * joint + row]);
                let bit = |place: usize| (bytes[place] >> row) & 1 == 1;
                let Some(found) = answer.solution(configuration) else {
                    assert!(!bit(exists) && joints.iter().all(|each| each.is_nan()));
                    continue;
                };
                assert!(bit(exists));
                assert_eq!(joints, found.joints);
                assert_eq!(bit(merged), found.merged);
                assert_eq!(bit(free), found.wrist_3_is_free);
                assert_eq!(bit(touching), found.touching);
            }
        }
        assert_eq!(answers.map(|each| each.count()), [8, 0]);
        let again = ClosedForm::of_doubles(&mut doubles).expect("it was made of answers");
        assert_eq!(again, answers);
        assert!(ClosedForm::of_doubles(&mut [0.0; 48]).is_none());
        // No certificate has this number.
        assert!(ClosedForm::of_doubles(&mut [f64::from_bits(u64::MAX); 49]).is_none());
    }
}
