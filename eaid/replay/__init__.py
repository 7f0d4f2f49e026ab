"""Plant + controller → Replay: the 1 kHz loop, scenarios, references, metrics, rehabilitation."""
