from .campaign import (
    renew_report as renew_report,
    write_campaign_report as write_campaign_report,
)
from .page import write_report as write_report
