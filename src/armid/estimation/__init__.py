"""Parameters from records, and how well the records pin them down."""
