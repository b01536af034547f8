from .campaign import (
    campaign_page as campaign_page,
    renew_report as renew_report,
    write_campaign_report as write_campaign_report,
)
from .page import (
    report_page as report_page,
    write_report as write_report,
)
