// Sums from which an exposure is estimated, those of `ColourSums` and two unused ones, four to a vector.

const SUMS = 24u;
