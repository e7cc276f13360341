"""Environments of our own, made of highway-env's parts."""
