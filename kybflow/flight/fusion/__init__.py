"""The error-state Kalman filter of the estimator `fusion`: covariance, replay of late measurements,
start and gates. Only estimators call it."""
