"""When an alert begins and when it ends, if one scan alone is not to decide."""

from monitor.verdict import ALERT, OK, UNAVAILABLE


class Hysteresis:
    """Alerts begin with the `alert_scans`-th scan in a row beyond a threshold and end with the `clear_scans`-th within.

    A scan without a verdict neither begins nor ends an alert, and breaks the rows of those that do.
    """

    def __init__(self, alert_scans: int, clear_scans: int) -> None:
        self._needed = {ALERT: alert_scans, OK: clear_scans}
        self._alerting = False
        self._row: tuple[str, int] = (OK, 0)  # the verdict of the scans before, and how many in a row had it

    def settle(self, verdict: str) -> tuple[str, list[str]]:
        """The verdict to tell for a scan that has this one by itself, and why it is another one."""
        self._row = (verdict, self._row[1] + 1) if verdict == self._row[0] else (verdict, 1)
        if verdict == UNAVAILABLE:
            return verdict, ["the alert before has not cleared"] if self._alerting else []
        count, needed = self._row[1], self._needed[verdict]
        if count >= needed:
            self._alerting = verdict == ALERT
        elif self._alerting and verdict == OK:
            return ALERT, [f"within the thresholds for {count} of the {needed} scans that clear the alert"]
        elif not self._alerting and verdict == ALERT:
            return UNAVAILABLE, [f"beyond a threshold for {count} of the {needed} scans that make an alert"]
        return verdict, []
