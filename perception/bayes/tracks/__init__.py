"""Tracks of objects: observed, refined, named, archived, and edited by the operator."""
