from .page import save_html as save_html
