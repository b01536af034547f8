from .setup_page import SetupPage as SetupPage
