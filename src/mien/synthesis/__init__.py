"""Expressions from feature points: examples mixed by geometry ([Zhang 2006])."""
