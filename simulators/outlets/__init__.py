"""Where simulated traffic goes. No outlet loses a byte to a slow reader, but for UDP and USB, as in life."""

from simulators.outlets.base import Closed, Outlet
from simulators.outlets.file import FileOutlet
from simulators.outlets.network import TcpOutlet, UdpOutlet
from simulators.outlets.pty import PtyOutlet, SlcanOutlet

__all__ = ["Closed", "FileOutlet", "Outlet", "PtyOutlet", "SlcanOutlet", "TcpOutlet", "UdpOutlet"]
