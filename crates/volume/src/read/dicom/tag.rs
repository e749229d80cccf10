//! The elements that are read. All others, and with them names, numbers and birth dates of patients, are skipped
//! unread.

/// Group and element.
pub(super) type Tag = u32;

macro_rules! tags {
    ($($(#[$doc:meta])* $name:ident = $value:literal;)*) => {
        $($(#[$doc])* pub(super) const $name: Tag = $value;)*
        /// Of values that are read, in order.
        const VALUES: &[Tag] = &[$($value),*];
    };
}

tags! {
    META_SOP_CLASS = 0x0002_0002;
    TRANSFER_SYNTAX = 0x0002_0010;
    REFERENCED_FILE = 0x0004_1500;
    IMAGE_TYPE = 0x0008_0008;
    SOP_CLASS = 0x0008_0016;
    SOP_INSTANCE_UID = 0x0008_0018;
    ACQUISITION_DATE_TIME = 0x0008_002A;
    ACQUISITION_TIME = 0x0008_0032;
    CONTENT_TIME = 0x0008_0033;
    MODALITY = 0x0008_0060;
    CODE_MEANING = 0x0008_0104;
    SERIES_DESCRIPTION = 0x0008_103E;
    FRAME_TYPE = 0x0008_9007;
    VOLUME_TECHNIQUE = 0x0008_9207;
    SLICE_THICKNESS = 0x0018_0050;
    KVP = 0x0018_0060;
    TRIGGER_TIME = 0x0018_1060;
    GANTRY_TILT = 0x0018_1120;
    KERNEL = 0x0018_1210;
    PATIENT_POSITION = 0x0018_5100;
    SERIES_UID = 0x0020_000E;
    SERIES_NUMBER = 0x0020_0011;
    ACQUISITION_NUMBER = 0x0020_0012;
    POSITION = 0x0020_0032;
    ORIENTATION = 0x0020_0037;
    FRAME_OF_REFERENCE = 0x0020_0052;
    TEMPORAL_POSITION = 0x0020_0100;
    IMAGE_COMMENTS = 0x0020_4000;
    STACK_ID = 0x0020_9056;
    TEMPORAL_POSITION_INDEX = 0x0020_9128;
    NOMINAL_CARDIAC_PERCENTAGE = 0x0020_9241;
    NOMINAL_RESPIRATORY_PERCENTAGE = 0x0020_9245;
    SAMPLES_PER_PIXEL = 0x0028_0002;
    PHOTOMETRIC = 0x0028_0004;
    FRAMES = 0x0028_0008;
    ROWS = 0x0028_0010;
    COLUMNS = 0x0028_0011;
    PIXEL_SPACING = 0x0028_0030;
    BITS_ALLOCATED = 0x0028_0100;
    BITS_STORED = 0x0028_0101;
    HIGH_BIT = 0x0028_0102;
    PIXEL_REPRESENTATION = 0x0028_0103;
    PADDING = 0x0028_0120;
    PADDING_LIMIT = 0x0028_0121;
    INTERCEPT = 0x0028_1052;
    SLOPE = 0x0028_1053;
    RESCALE_TYPE = 0x0028_1054;
    LOSSY = 0x0028_2110;
    SEGMENTATION_TYPE = 0x0062_0001;
    SEGMENT_NUMBER = 0x0062_0004;
    SEGMENT_LABEL = 0x0062_0005;
    REFERENCED_SEGMENT = 0x0062_000B;
    GREATEST_FRACTION = 0x0062_000E;
    ROI_NUMBER = 0x3006_0022;
    REFERENCED_FRAME = 0x3006_0024;
    ROI_NAME = 0x3006_0026;
    CONTOUR_TYPE = 0x3006_0042;
    CONTOUR_POINTS = 0x3006_0046;
    CONTOUR_DATA = 0x3006_0050;
    REFERENCED_ROI = 0x3006_0084;
    ROI_TYPE = 0x3006_00A4;
}

/// Integers that are written as texts, and those of four bytes; all others have two.
pub(super) const INTEGER_STRINGS: [Tag; 6] = [
    SERIES_NUMBER,
    ACQUISITION_NUMBER,
    FRAMES,
    ROI_NUMBER,
    CONTOUR_POINTS,
    REFERENCED_ROI,
];
pub(super) const LONGS: [Tag; 1] = [TEMPORAL_POSITION_INDEX];

/// Sequences that are gone into.
pub(super) const DIRECTORY_RECORDS: Tag = 0x0004_1220;
pub(super) const SHARED_GROUPS: Tag = 0x5200_9229;
pub(super) const FRAME_GROUPS: Tag = 0x5200_9230;
pub(super) const SEGMENTS: Tag = 0x0062_0002;
pub(super) const SEGMENT_TYPE: Tag = 0x0062_000F;
pub(super) const SEGMENT_TYPE_MODIFIER: Tag = 0x0062_0011;
pub(super) const MODALITY_LUT: Tag = 0x0028_3000;
pub(super) const REFERENCED_FRAMES: Tag = 0x3006_0010;
pub(super) const REFERENCED_STUDIES: Tag = 0x3006_0012;
pub(super) const REFERENCED_SERIES: Tag = 0x3006_0014;
pub(super) const STRUCTURES: Tag = 0x3006_0020;
pub(super) const ROI_CONTOURS: Tag = 0x3006_0039;
pub(super) const CONTOURS: Tag = 0x3006_0040;
pub(super) const OBSERVATIONS: Tag = 0x3006_0080;
pub(super) const ROI_CODE: Tag = 0x3006_0086;
const PLANE_POSITION: Tag = 0x0020_9113;
const PLANE_ORIENTATION: Tag = 0x0020_9116;
const FRAME_CONTENT: Tag = 0x0020_9111;
const PIXEL_MEASURES: Tag = 0x0028_9110;
const PIXEL_TRANSFORMATION: Tag = 0x0028_9145;
const CT_FRAME_TYPE: Tag = 0x0018_9329;
const CT_RECONSTRUCTION: Tag = 0x0018_9314;
const CT_X_RAY: Tag = 0x0018_9325;
const SEGMENT_IDENTIFICATION: Tag = 0x0062_000A;
const CARDIAC_SYNCHRONIZATION: Tag = 0x0018_9118;
const RESPIRATORY_SYNCHRONIZATION: Tag = 0x0020_9253;
const X_RAY_3D_FRAME_TYPE: Tag = 0x0018_9504;

const SEQUENCES: [Tag; 27] = [
    RESPIRATORY_SYNCHRONIZATION,
    X_RAY_3D_FRAME_TYPE,
    DIRECTORY_RECORDS,
    CONTOURS,
    OBSERVATIONS,
    REFERENCED_FRAMES,
    REFERENCED_SERIES,
    REFERENCED_STUDIES,
    ROI_CODE,
    ROI_CONTOURS,
    STRUCTURES,
    CARDIAC_SYNCHRONIZATION,
    CT_RECONSTRUCTION,
    CT_X_RAY,
    CT_FRAME_TYPE,
    FRAME_CONTENT,
    PLANE_POSITION,
    PLANE_ORIENTATION,
    MODALITY_LUT,
    PIXEL_MEASURES,
    PIXEL_TRANSFORMATION,
    SEGMENTS,
    SEGMENT_IDENTIFICATION,
    SEGMENT_TYPE,
    SEGMENT_TYPE_MODIFIER,
    SHARED_GROUPS,
    FRAME_GROUPS,
];

/// Sequences of one item each, whose values count as the frame's own.
pub(super) const OF_FRAME: [Tag; 12] = [
    RESPIRATORY_SYNCHRONIZATION,
    X_RAY_3D_FRAME_TYPE,
    PLANE_POSITION,
    PLANE_ORIENTATION,
    FRAME_CONTENT,
    PIXEL_MEASURES,
    PIXEL_TRANSFORMATION,
    CT_FRAME_TYPE,
    CT_RECONSTRUCTION,
    CT_X_RAY,
    SEGMENT_IDENTIFICATION,
    CARDIAC_SYNCHRONIZATION,
];

pub(super) const PIXELS: Tag = 0x7FE0_0010;
pub(super) const ITEM: Tag = 0xFFFE_E000;
pub(super) const END_OF_ITEM: Tag = 0xFFFE_E00D;
pub(super) const END_OF_SEQUENCE: Tag = 0xFFFE_E0DD;

pub(super) fn is_value(tag: Tag) -> bool {
    VALUES.binary_search(&tag).is_ok()
}

pub(super) fn is_sequence(tag: Tag) -> bool {
    SEQUENCES.contains(&tag)
}

/// `(0028,1053)`, as the standard writes it.
pub(super) fn written(tag: Tag) -> String {
    format!("({:04X},{:04X})", tag >> 16, tag & 0xFFFF)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_are_in_order_and_none_is_of_the_patient() {
        assert!(VALUES.is_sorted());
        assert!(VALUES.iter().all(|tag| tag >> 16 != 0x0010));
        assert_eq!(written(SLOPE), "(0028,1053)");
    }
}
