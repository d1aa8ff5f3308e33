"""Reports: one HTML page on a device and its field model, and pictures of devices."""

from magfem.report.write import show_picture, write_report

__all__ = ["show_picture", "write_report"]
