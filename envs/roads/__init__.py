"""What both simulators drive on: networks, lane frames, paths, the ways that road users may take."""
