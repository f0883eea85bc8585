"""`kybflow test`: missions flown as tests."""
