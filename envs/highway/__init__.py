"""The shield on highway-env's own objects."""
