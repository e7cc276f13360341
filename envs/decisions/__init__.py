"""What is known of a decision before it is carried out: would it be answered, and what else would not?"""
