"""Lids that close on eyeballs and lips that meet without passing each other."""
