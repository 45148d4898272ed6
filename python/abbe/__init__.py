"""x"""
from abbe._core import __version__
