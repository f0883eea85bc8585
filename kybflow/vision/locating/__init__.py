"""Localization from tags: detection in whole images, search near a prediction, the pose from
corners, and the locator that combines them."""
