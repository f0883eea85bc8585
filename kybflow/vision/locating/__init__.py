"""Localization from tags: detection in whole images, search near a prediction, the computation of a
pose from corners, and the locator that combines them."""
