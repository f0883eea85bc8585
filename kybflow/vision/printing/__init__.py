"""Printed tags: sheets, marks and floors as PDF."""
