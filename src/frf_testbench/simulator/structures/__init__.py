"""Structures as they really are, each by another discretisation than the nominal one."""
